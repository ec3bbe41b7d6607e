/** Whether the mask network finds the same object when it is asked in other ways, as anyprobe.masks.quality does. */

import { objectBox } from "./picture.js";
import { propose } from "./propose.js";
import { resize } from "./resize.js";

/**
 * The least IoU of a mask with what the network finds in the mirrored picture and in a box around the mask.
 *
 * @param {(input: Float32Array) => Promise<Float32Array>} run the network
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask of the picture
 * @param {import("./picture.js").Hints} hints that gave it
 * @returns {Promise<number>} 0 where the mask is empty
 */
export async function agreement(run, picture, mask, hints) {
  const { width, height, rgba } = picture;
  const box = objectBox(mask, width);
  if (!box) return 0;
  const pixels = mirrored(new Uint32Array(rgba.buffer, rgba.byteOffset, width * height), width);
  const flipped = { width, height, rgba: new Uint8ClampedArray(pixels.buffer) };
  const inMirror = await propose(run, flipped, mirroredHints(hints, width));
  const inBox = await propose(run, picture, { on: [], off: [], box });
  return Math.min(iou(inMirror, mirrored(mask, width), picture), iou(inBox, mask, picture));
}

/** IoU of a cover with a mask of its picture, at the cover's resolution. */
function iou({ values, width, height }, mask, picture) {
  const small = resize(mask, 1, [picture.width, picture.height], [width, height]);
  let [both, either] = [0, 0];
  for (let i = 0; i < values.length; i++) {
    const [a, b] = [values[i] > 0.5, small[i] > 0.5];
    if (a && b) both++;
    if (a || b) either++;
  }
  return either ? both / either : 0;
}

/** Values row by row, left to right. */
function mirrored(values, width) {
  const out = new values.constructor(values.length);
  for (let at = 0; at < values.length; at++) {
    const column = at % width;
    out[at] = values[at - column + width - 1 - column];
  }
  return out;
}

function mirroredHints({ on, off, box }, width) {
  const place = ([x, y]) => [width - x, y];
  return { on: on.map(place), off: off.map(place), box: box && [width - box[2], box[1], width - box[0], box[3]] };
}
