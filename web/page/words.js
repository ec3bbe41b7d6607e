/** What package and server say, in the words of the page and of its controls. */

/** What is given by which control, by the package's options and the server's fields. */
const CONTROLS = {
  pitchDeg: () => "set “Camera pitch”",
  surroundings: () => "choose “the whole photo” at “Look at”",
  click: () => "click on the object",
  exclude: () => null, // a click with Shift, told of beside the photo
  box: () => "draw a box around it",
  mask: () => null, // the page takes none
};

/** What can be done about a file that cannot be opened. */
const ACTIONS = {
  "choose-photo": "Choose a photo: JPEG, PNG, HEIC, TIFF, EXR or another common format.",
  "use-video": "Choose a photo, or use the camera.",
};

/** A doubt, and the controls that mend it. @param {import("../src/notices.js").Notice} notice */
export function inPage({ text, remedy }) {
  const advice = remedy.map(({ name }) => CONTROLS[name]?.()).filter(Boolean);
  return advice.length ? `${text}; ${advice.join(", or ")}` : text;
}

/**
 * Why the server refused a file.
 *
 * @param {{detail: string, text?: string, remedy?: {do: string, name: string}[]}} problem its answer, of RFC 9457
 * @param {string} name the file's
 */
export function refusal({ detail, text = detail, remedy = [] }, name) {
  const advice = remedy.map((one) => ACTIONS[one.name]).filter(Boolean);
  return [`${name}: ${text}`, ...advice].join(advice.length ? ". " : "");
}

/** A doubt as a sentence. @param {import("../src/notices.js").Notice} [notice] */
export const sentence = ({ text } = { text: "nothing stands out there" }) => `${text[0].toUpperCase()}${text.slice(1)}.`;
