/** What package and server say, in the words of the page and of its controls. */

import { Words } from "../src/notices.js";

/** What gives an option of the package or a field of the server; null: what the page takes nowhere, or tells of elsewhere. */
const CONTROLS = {
  pitchDeg: "set “Camera pitch”",
  surroundings: "choose “the whole photo” at “Look at”",
  click: "click on the object",
  exclude: null, // a click with Shift, told of beside the picture
  box: "draw a box around it",
  mask: null,
  material: null,
};

const LABELS = { pitchDeg: "“Camera pitch”", surroundings: "“Look at”", click: "the click", exclude: "the click with Shift", box: "the box", threads: "?threads" };

/** What can be done about a file that cannot be opened. */
const ACTIONS = {
  "fetch-masks": "for the better one run anyprobe mask --fetch where this page is served",
  "choose-photo": "choose a photo: JPEG, PNG, HEIC, TIFF, EXR or another common format",
  "use-video": "choose a photo, or use the camera",
};

class PageWords extends Words {
  name(option) {
    return LABELS[option] ?? null;
  }

  giving(options) {
    return options.map(({ name }) => CONTROLS[name]).filter(Boolean).join(", or ");
  }

  leavingOut(options) {
    return options.some(({ name }) => name === "surroundings") ? "choose “automatic” at “Look at”" : null;
  }

  action(name) {
    return ACTIONS[name] ?? null;
  }
}

export const PAGE = new PageWords();

/**
 * The server's answer of an error as a line.
 *
 * @param {{detail: string} & Partial<import("../src/notices.js").Notice>} problem of RFC 9457
 */
export const problemLine = ({ detail, text = detail, subject, remedy }) => PAGE.line({ text, subject, remedy });

/** An error as a line: the package's in the page's words. @param {Error & {notice?: import("../src/notices.js").Notice}} error */
export const errorLine = (error) => (error.notice ? PAGE.line(error.notice) : error.message);

/** A doubt as a sentence. @param {import("../src/notices.js").Notice} [notice] */
export const sentence = ({ text } = { text: "nothing stands out there" }) => `${text[0].toUpperCase()}${text.slice(1)}.`;
