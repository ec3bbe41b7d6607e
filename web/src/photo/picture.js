/**
 * A picture in memory.
 *
 * @typedef {object} Picture
 * @property {number} width
 * @property {number} height
 * @property {Uint8ClampedArray} rgba display values of the upright picture, four bytes a pixel, not premultiplied
 *
 * A mask is a Float32Array of width * height numbers in [0, 1], 1 on the object. Arguments called picture, mask, hints, models
 * (networks/models.js) and found (a Finding of photo/search.js) are these everywhere.
 *
 * @typedef {object} Hints what was marked on a picture
 * @property {number[][]} on x, y of clicks on the object
 * @property {number[][]} off likewise beside it
 * @property {number[] | null} [box] x0, y0, x1, y1 around it
 */

import { CONTRACT } from "../core/contract.js";

/** Smallest longer side of an object's bounding box, in pixels of the picture. */
export const MIN_OBJECT_PX = CONTRACT.mask.least_object_px;

/** Whether a box of objectBox is that of an object, and large enough. */
export const isLarge = (box) => box !== null && Math.max(box[2] - box[0], box[3] - box[1]) >= MIN_OBJECT_PX;

/** Bounding box [x0, y0, x1, y1] (exclusive) of mask > 0.5, or null where nothing is. */
export function objectBox(mask, width) {
  let [x0, y0, x1, y1] = [width, -1, -1, -1];
  for (let y = 0, row = 0; row < mask.length; y++, row += width) {
    let first = 0;
    while (first < width && !(mask[row + first] > 0.5)) first++;
    if (first === width) continue;
    let last = width - 1;
    while (!(mask[row + last] > 0.5)) last--;
    if (first < x0) x0 = first;
    if (last > x1) x1 = last;
    if (y0 < 0) y0 = y;
    y1 = y;
  }
  return y1 < 0 ? null : [x0, y0, x1 + 1, y1 + 1];
}

/**
 * The picture's own transparency as a mask, or null where it cuts nothing away: where it is the same or above one half
 * everywhere, as editors write it into opaque pictures.
 */
export function maskFromAlpha({ rgba }) {
  let [least, most] = [255, 0];
  const mask = new Float32Array(rgba.length / 4);
  for (let i = 0; i < mask.length; i++) {
    const alpha = rgba[4 * i + 3];
    mask[i] = alpha / 255;
    if (alpha < least) least = alpha;
    if (alpha > most) most = alpha;
  }
  return least / 255 <= CONTRACT.mask.inside && least < most ? mask : null;
}
