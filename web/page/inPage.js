/** What package and server say, in the words of the page and of its controls. */

const WORDS = [
  [/give the pitch$/, "set “Camera pitch”"],
  [/choose surroundings "photo"$/, "choose “the whole photo” at “Look at”"],
  [/expected IoU/, "estimated quality"],
];

/** What is advised or doubted. @param {string} line */
export const inPage = (line) => WORDS.reduce((said, [theirs, ours]) => said.replace(theirs, ours), line);

/** What a chosen file is, where it is nothing that a decoder takes. */
const NO_PHOTOS = [
  [/got \d+ bytes of something else/, "this file is no picture. Choose a photo: JPEG, PNG, HEIC, TIFF, EXR or another common format."],
  [/got a video/, "this file is a video. Choose a photo, or use the camera."],
];

/** Why a file was refused. @param {string} line of the server, which calls it "photo" @param {string} name */
export function refusal(line, name) {
  const [, ours] = NO_PHOTOS.find(([theirs]) => theirs.test(line)) ?? [];
  return ours ? `${name}: ${ours}` : line.replace(/^photo:/, `${name}:`);
}
