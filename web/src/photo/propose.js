/** The mask network finds the object, from clicks or from nothing, as anyprobe.masks.propose. */

import { MASK_SIZE } from "../networks/models.js";
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
 * @param {{on: number[][], off: number[][]}} clicks x, y in pixels of the picture
 * @param {{again?: boolean}} [options] again: look at a small object a second time
 * @returns {Promise<Cover>}
 */
export async function propose(run, picture, clicks, { again = true } = {}) {
  const { width, height } = picture;
  const first = await look(run, picture, windowOf([0, 0], [width, height]), clicks, null);
  const seen = objectBox(first.values, first.width);
  if (!again || !seen) return first;
  const [across, down] = [width / first.width, height / first.height];
  const box = [seen[0] * across, seen[1] * down, seen[2] * across, seen[3] * down];
  const longer = Math.max(box[2] - box[0], box[3] - box[1]);
  if (longer >= AGAIN_BELOW * Math.max(width, height)) return first;
  const window = squareAround(box, AGAIN_SIDE * longer, width, height);
  const closer = await look(run, picture, window, clicks, clicks.on.length ? null : box);
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

function squareAround(box, side, width, height) {
  const spans = [width, height].map((length, axis) => {
    const extent = Math.min(length, Math.max(1, Math.round(side)));
    const middle = (box[axis] + box[axis + 2]) / 2;
    return [Math.min(Math.max(Math.round(middle - extent / 2), 0), length - extent), extent];
  });
  return windowOf([spans[0][0], spans[1][0]], [spans[0][1], spans[1][1]]);
}

/** One run of the network on a window. */
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
  const kept = keepLargeParts(values.map((value) => (value > 0.5 ? 1 : 0)), width);
  let [inside, count, outside] = [0, 0, 0];
  values.forEach((value, i) => {
    if (kept[i] && value > 0.5) {
      inside += value;
      count += 1;
    } else outside += value;
  });
  return {
    values: values.map((value, i) => value * kept[i]),
    width,
    height,
    confidence: count ? inside / (count + outside) : 0,
  };
}

function networkInput({ width, rgba }, window, hints) {
  const [x0, y0] = window.origin;
  const [w, h] = window.size;
  const rgb = new Float32Array(3 * w * h);
  for (let y = 0; y < h; y++) {
    let from = 4 * ((y0 + y) * width + x0);
    for (let to = 3 * y * w; to < 3 * (y + 1) * w; to += 3, from += 4) {
      rgb[to] = rgba[from] / 255;
      rgb[to + 1] = rgba[from + 1] / 255;
      rgb[to + 2] = rgba[from + 2] / 255;
    }
  }
  const [columns, rows] = window.inner;
  const small = resize(rgb, 3, window.size, window.inner);
  const plane = MASK_SIZE * MASK_SIZE;
  const input = new Float32Array(4 * plane).fill(GREY, 0, 3 * plane);
  for (let y = 0; y < rows; y++) {
    for (let x = 0; x < columns; x++) {
      const to = (window.start[1] + y) * MASK_SIZE + window.start[0] + x;
      for (let c = 0; c < 3; c++) input[c * plane + to] = small[3 * (y * columns + x) + c];
    }
  }
  input.set(hints, 3 * plane);
  return input;
}

/** The hint channel [160, 160], as anyprobe.core.hints: box and clicks on the object less clicks beside it. */
export function drawHints(on, off, box = null) {
  const blob = ([x, y], column, row) =>
    Math.exp(-0.5 * (((column + 0.5 - x) / CLICK_SIGMA_PX) ** 2 + ((row + 0.5 - y) / CLICK_SIGMA_PX) ** 2));
  return Float32Array.from({ length: MASK_SIZE * MASK_SIZE }, (_, i) => {
    const [column, row] = [i % MASK_SIZE, Math.floor(i / MASK_SIZE)];
    const [x, y] = [column + 0.5, row + 0.5];
    const isBoxed = box && x >= box[0] && x < box[2] && y >= box[1] && y < box[3];
    const most = (points, least) => points.reduce((value, p) => Math.max(value, blob(p, column, row)), least);
    return Math.min(Math.max(most(on, isBoxed ? BOX_LEVEL : 0) - most(off, 0), -1), 1);
  });
}

/** The mask without loose parts below PART_SHARE of the largest, grown by a pixel. */
export function keepLargeParts(inside, width) {
  const part = new Int32Array(inside.length);
  const sizes = [0];
  const neighbours = (at) => {
    const x = at % width;
    return [x > 0 ? at - 1 : -1, x < width - 1 ? at + 1 : -1, at - width, at + width];
  };
  for (let start = 0; start < inside.length; start++) {
    if (!inside[start] || part[start]) continue;
    const number = sizes.push(0) - 1;
    const waiting = [start];
    part[start] = number;
    while (waiting.length) {
      const at = waiting.pop();
      sizes[number] += 1;
      for (const next of neighbours(at)) {
        if (next < 0 || next >= inside.length || !inside[next] || part[next]) continue;
        part[next] = number;
        waiting.push(next);
      }
    }
  }
  const least = PART_SHARE * Math.max(...sizes);
  const kept = Uint8Array.from(part, (number) => (number && sizes[number] >= least ? 1 : 0));
  const grown = kept.slice();
  kept.forEach((value, at) => {
    if (value) for (const next of neighbours(at)) if (next >= 0 && next < grown.length) grown[next] = 1;
  });
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
