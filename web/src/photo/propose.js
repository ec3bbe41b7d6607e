/** The mask network finds the object, from clicks, a box or nothing, as anyprobe.masks.propose. */

import { MASK_SIZE } from "../networks/models.js";
import { labelParts } from "./parts.js";
import { objectBox } from "./picture.js";
import { resize } from "./resize.js";

const GREY = 0.5;
const BOX_LEVEL = 0.5;
const CLICK_SIGMA_PX = 4;
/** An object smaller than this share of the photo is looked at again, closer. */
const AGAIN_BELOW = 0.6;
const AGAIN_SIDE = 1.7;
/** Loose parts below this share of the largest are dropped. */
const PART_SHARE = 0.2;

/**
 * @typedef {object} Cover what the network said of a photo
 * @property {Float32Array} values width * height in [0, 1]
 * @property {number} width of the cover, which has the photo's extent and its own resolution
 * @property {number} height
 * @property {number} confidence the IoU to be expected; 0 where nothing was found
 */

/**
 * @param {(input: Float32Array) => Promise<Float32Array>} run the network: [4, 160, 160] to [160, 160]
 * @param {import("./picture.js").Picture} picture
 * @param {import("./picture.js").Hints} hints in pixels of the picture
 * @param {{again?: boolean}} [options] again: look at a small object a second time
 * @returns {Promise<Cover>}
 */
export async function propose(run, picture, hints, { again = true } = {}) {
  const { width, height } = picture;
  const first = await look(run, picture, windowOf([0, 0], [width, height]), hints, hints.box);
  const seen = objectBox(first.values, first.width);
  if (!again || !seen) return first;
  const [across, down] = [width / first.width, height / first.height];
  const box = [seen[0] * across, seen[1] * down, seen[2] * across, seen[3] * down];
  const longer = Math.max(box[2] - box[0], box[3] - box[1]);
  if (longer >= AGAIN_BELOW * Math.max(width, height)) return first;
  const window = around(box, width, height);
  const closer = await look(run, picture, window, hints, hints.box ?? (hints.on.length ? null : box));
  return closer.confidence < first.confidence ? first : paste(closer, window, width, height);
}

/** A window of a photo (x, y and size in its pixels) in the network's square. */
function windowOf(origin, size) {
  const scale = MASK_SIZE / Math.max(...size);
  const inner = size.map((length) => Math.min(MASK_SIZE, Math.max(1, Math.round(length * scale))));
  const start = inner.map((length) => Math.floor((MASK_SIZE - length) / 2));
  const place = ([x, y]) => [
    start[0] + ((x - origin[0]) * inner[0]) / size[0],
    start[1] + ((y - origin[1]) * inner[1]) / size[1],
  ];
  return { origin, size, inner, start, place };
}

/** A square window around a box, moved into the photo. */
function around(box, width, height) {
  const side = AGAIN_SIDE * Math.max(box[2] - box[0], box[3] - box[1]);
  const spans = [width, height].map((length, axis) => {
    const extent = Math.min(length, Math.max(1, Math.round(side)));
    const middle = (box[axis] + box[axis + 2]) / 2;
    return [Math.min(Math.max(Math.round(middle - extent / 2), 0), length - extent), extent];
  });
  return windowOf([spans[0][0], spans[1][0]], [spans[0][1], spans[1][1]]);
}

/** One run of the network on a window; the cover is the window's. */
async function look(run, picture, window, clicks, box) {
  const corners = box && [...window.place(box.slice(0, 2)), ...window.place(box.slice(2))];
  const hints = drawHints(clicks.on.map(window.place), clicks.off.map(window.place), corners);
  const answer = await run(networkInput(picture, window, hints));
  const [width, height] = window.inner;
  const values = new Float32Array(width * height);
  for (let y = 0; y < height; y++) {
    const from = (window.start[1] + y) * MASK_SIZE + window.start[0];
    values.set(answer.subarray(from, from + width), y * width);
  }
  const isInside = new Uint8Array(values.length);
  for (let i = 0; i < values.length; i++) isInside[i] = values[i] > 0.5 ? 1 : 0;
  const kept = keepLargeParts(isInside, width);
  let [inside, count, outside] = [0, 0, 0];
  for (let i = 0; i < values.length; i++) {
    if (kept[i] && isInside[i]) {
      inside += values[i];
      count += 1;
    } else outside += values[i];
    if (!kept[i]) values[i] = 0;
  }
  return { values, width, height, confidence: count ? inside / (count + outside) : 0 };
}

function networkInput({ width, height, rgba }, window, hints) {
  const [x0, y0] = window.origin;
  const [w, h] = window.size;
  let part = rgba;
  if (w !== width || h !== height) {
    part = new rgba.constructor(4 * w * h);
    for (let y = 0; y < h; y++) {
      const from = 4 * ((y0 + y) * width + x0);
      part.set(rgba.subarray(from, from + 4 * w), 4 * y * w);
    }
  }
  const [columns, rows] = window.inner;
  const small = resize(part, 4, window.size, window.inner);
  const plane = MASK_SIZE * MASK_SIZE;
  const input = new Float32Array(4 * plane).fill(GREY, 0, 3 * plane);
  for (let y = 0, from = 0; y < rows; y++) {
    let to = (window.start[1] + y) * MASK_SIZE + window.start[0];
    for (let x = 0; x < columns; x++, to++, from += 4) {
      for (let c = 0; c < 3; c++) input[c * plane + to] = small[from + c] / 255;
    }
  }
  input.set(hints, 3 * plane);
  return input;
}

/** The hint channel [160, 160], as anyprobe.core.hints: box and clicks on the object less clicks beside it. */
export function drawHints(on, off, box = null) {
  const hints = new Float32Array(MASK_SIZE * MASK_SIZE);
  if (box) {
    for (let i = 0; i < hints.length; i++) {
      const [x, y] = [(i % MASK_SIZE) + 0.5, Math.floor(i / MASK_SIZE) + 0.5];
      if (x >= box[0] && x < box[2] && y >= box[1] && y < box[3]) hints[i] = BOX_LEVEL;
    }
  }
  drawBlobs(on, hints);
  const against = drawBlobs(off, new Float32Array(hints.length));
  for (let i = 0; i < hints.length; i++) hints[i] -= against[i];
  return hints;
}

/** Raise values to a round blob of height 1 about each point. */
function drawBlobs(points, values) {
  const axis = (middle) =>
    Float64Array.from({ length: MASK_SIZE }, (_, i) => Math.exp(-0.5 * ((i + 0.5 - middle) / CLICK_SIGMA_PX) ** 2));
  for (const point of points) {
    const [across, down] = point.map(axis);
    for (let row = 0, i = 0; row < MASK_SIZE; row++) {
      for (let column = 0; column < MASK_SIZE; column++, i++) {
        values[i] = Math.max(values[i], across[column] * down[row]);
      }
    }
  }
  return values;
}

/** The mask without loose parts below PART_SHARE of the largest, grown by a pixel. */
export function keepLargeParts(inside, width) {
  const count = inside.length;
  const { labels, sizes } = labelParts(inside, width);
  const least = PART_SHARE * Math.max(...sizes);
  const grown = new Uint8Array(count);
  for (let at = 0; at < count; at++) {
    if (!labels[at] || sizes[labels[at]] < least) continue;
    const x = at % width;
    grown[at] = 1;
    if (x > 0) grown[at - 1] = 1;
    if (x < width - 1) grown[at + 1] = 1;
    if (at >= width) grown[at - width] = 1;
    if (at + width < count) grown[at + width] = 1;
  }
  return grown;
}

/** A window's cover in the photo's extent, at the window's resolution or the photo's, if that is coarser. */
function paste(cover, window, width, height) {
  const fine = Math.min(1, Math.max(cover.width, cover.height) / Math.max(...window.size));
  const size = [width, height].map((length) => Math.max(1, Math.round(length * fine)));
  const scale = [size[0] / width, size[1] / height];
  const start = window.origin.map((value, axis) => Math.round(value * scale[axis]));
  const extent = window.size.map((length, axis) =>
    Math.min(size[axis] - start[axis], Math.max(1, Math.round(length * scale[axis]))),
  );
  const small = resize(cover.values, 1, [cover.width, cover.height], extent);
  const values = new Float32Array(size[0] * size[1]);
  for (let y = 0; y < extent[1]; y++) {
    const to = (start[1] + y) * size[0] + start[0];
    values.set(small.subarray(y * extent[0], (y + 1) * extent[0]), to);
  }
  return { values, width: size[0], height: size[1], confidence: cover.confidence };
}
