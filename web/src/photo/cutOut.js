/** The object cut out of a still picture from what the mask network proposes or from a box, as anyprobe.masks.grabcut. */

import { grabCut, MAYBE_OFF, MAYBE_ON, OFF, ON } from "./grabcut.js";
import { objectBox } from "./picture.js";
import { resize } from "./resize.js";

const LONG_PX = 640;
const ROUNDS = 5;
/** Reach around the proposal's box in which the object may be found, in the box's longer sides. */
const MARGIN = 0.12;
/** Radius around a click that is believed, in longer sides of the picture. */
const CLICK_SURE = 0.02;

/**
 * @param {import("./picture.js").Picture} picture
 * @param {import("./propose.js").Cover} cover the object is somewhere around cover > 0.5
 * @param {import("./picture.js").Hints} hints in pixels of the picture; the box counts in the proposal alone
 * @returns {Float32Array} a mask of the picture; empty where nothing stands out
 */
export function cutOut(picture, cover, hints) {
  const small = shrink(picture);
  const coarse = resize(cover.values, 1, [cover.width, cover.height], small.size);
  return cut(picture, small, coverLabels(coarse, small.size), hints);
}

/**
 * The same without a network: what the box has inside, and it alone, may be the object.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {import("./picture.js").Hints} hints in pixels of the picture; clicks correct the box
 * @returns {Float32Array} a mask of the picture
 */
export function cutOutOfBox(picture, hints) {
  const small = shrink(picture);
  return cut(picture, small, boxLabels(hints.box.map((value) => value * small.scale), small.size), hints);
}

function cut(picture, small, labels, clicks) {
  markClicks(labels, small, clicks);
  if (labels.every((label) => label % 2 === 1)) labels.fill(OFF); // nothing that it could stand out from
  grabCut(small.rgb, small.size, labels, ROUNDS);
  return enlarge(labels, small.size, [picture.width, picture.height]);
}

/** The picture at most LONG_PX long, three bytes a pixel. */
function shrink({ width, height, rgba }) {
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  const size = [width, height].map((length) => Math.max(1, Math.round(length * scale)));
  const values = scale < 1 ? resize(rgba, 4, [width, height], size) : rgba;
  const rgb = new Uint8ClampedArray(3 * size[0] * size[1]);
  for (let from = 0, to = 0; to < rgb.length; from += 4, to += 3) {
    rgb[to] = values[from];
    rgb[to + 1] = values[from + 1];
    rgb[to + 2] = values[from + 2];
  }
  return { rgb, size, scale };
}

/** Perhaps the object inside a box x0, y0, x1, y1, surely not around it. */
export function boxLabels([x0, y0, x1, y1], [width, height]) {
  let left = Math.min(Math.floor(x0), width - 1);
  const top = Math.min(Math.floor(y0), height - 1);
  let right = Math.min(width, Math.max(left + 1, Math.round(x1)));
  const bottom = Math.min(height, Math.max(top + 1, Math.round(y1)));
  const isWhole = left === 0 && top === 0 && right === width && bottom === height;
  if (isWhole) [left, right] = [1, width - 1]; // the surroundings must not be empty
  const labels = new Uint8Array(width * height).fill(OFF);
  for (let y = top; y < bottom; y++) labels.fill(MAYBE_ON, y * width + left, y * width + right);
  return labels;
}

function coverLabels(coarse, [width, height]) {
  const labels = new Uint8Array(coarse.length).fill(OFF);
  const box = objectBox(coarse, width);
  if (box) {
    const more = Math.max(2, Math.round(MARGIN * Math.max(box[2] - box[0], box[3] - box[1])));
    for (let y = Math.max(box[1] - more, 0); y < Math.min(box[3] + more, height); y++) {
      for (let x = Math.max(box[0] - more, 0); x < Math.min(box[2] + more, width); x++) {
        labels[y * width + x] = coarse[y * width + x] > 0.5 ? MAYBE_ON : MAYBE_OFF;
      }
    }
  }
  return labels;
}

function markClicks(labels, { size: [width, height], scale }, clicks) {
  const reach = CLICK_SURE * Math.max(width, height);
  for (const [points, label] of [[clicks.on, ON], [clicks.off, OFF]]) {
    for (const point of points) {
      const [column, row] = point.map((value) => value * scale);
      labels.forEach((_, i) => {
        const [x, y] = [(i % width) + 0.5, Math.floor(i / width) + 0.5];
        if (Math.hypot(x - column, y - row) < reach) labels[i] = label;
      });
    }
  }
}

/** What was cut out, smoothed and in the picture's size. */
function enlarge(labels, size, to) {
  const inside = new Float32Array(labels).map((label) => label % 2);
  const smooth = resize(blur(inside, size), 1, size, to);
  return smooth.map((value) => Math.min(Math.max((value - 0.25) / 0.5, 0), 1));
}

/** By a Gaussian of one pixel. */
function blur(values, [width, height]) {
  const weights = [-3, -2, -1, 0, 1, 2, 3].map((offset) => Math.exp(-0.5 * offset * offset));
  const sum = weights.reduce((total, weight) => total + weight, 0);
  const along = (from, lines, length, line, step) => {
    const out = new Float32Array(from.length);
    for (let l = 0; l < lines; l++) {
      for (let i = 0; i < length; i++) {
        let total = 0;
        for (let k = -3; k <= 3; k++) {
          const at = Math.min(Math.max(i + k, 0), length - 1);
          total += weights[k + 3] * from[l * line + at * step];
        }
        out[l * line + i * step] = total / sum;
      }
    }
    return out;
  };
  return along(along(values, height, width, width, 1), width, height, 1, width);
}
