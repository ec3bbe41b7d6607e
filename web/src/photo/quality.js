/** How good a found mask is, as anyprobe.masks.quality: what the network expects, and whether other ways give the same. */

import { luminance } from "../core/color.js";
import { colorsApart } from "./colorsApart.js";
import { oneObject } from "./parts.js";
import { objectBox } from "./picture.js";
import { around, look, propose } from "./propose.js";
import { resize } from "./resize.js";

/** Expected IoU below which a mask comes with a warning. */
export const DOUBTFUL = 0.8;

const OFFSET = -8.18;
/** Of the log-odds of the IoU. */
const WEIGHTS = {
  expected: 2.93,
  mirrored: 3.44,
  byBox: 0.06,
  byClick: 0.21,
  grey: 0.15,
  kept: 0.54,
  onePart: 0.85,
  toldApart: 2.21,
  edge: 1.21,
  small: -0.35,
};
/** Power of the display values of the picture that is asked about again, exposed less. */
const DARKER = 1.8;
/** Longer side at which edges are compared. */
const WORK_PX = 160;

/**
 * @typedef {object} Evidence what speaks for a mask, each from 0 to 1 where 1 is good, and what makes masks doubtful, by
 *   the names of anyprobe.masks.quality.Evidence
 */

/**
 * The IoU to expect of a mask that is not empty, and a line of what looks wrong where that is little.
 *
 * @param {(input: Float32Array) => Promise<Float32Array>} run the network
 * @param {import("./picture.js").Picture} picture
 * @param {import("./propose.js").Cover} cover what the network proposed
 * @param {Float32Array} mask of the picture, cut out there
 * @param {import("./picture.js").Hints} hints that gave it
 * @returns {Promise<{quality: number, warnings: string[]}>}
 */
export async function qualityOf(run, picture, cover, mask, hints) {
  const evidence = await examine(run, picture, cover, mask, hints);
  const quality = expectedIou(evidence);
  if (quality >= DOUBTFUL) return { quality, warnings: [] };
  const [first] = doubts(evidence);
  const because = first ? `: ${first}` : "";
  return { quality, warnings: [`The mask may be wrong (expected IoU ${quality.toFixed(2)}${because}).`] };
}

/** By WEIGHTS, but no more than a proposal that disagrees leaves likely. */
export function expectedIou(evidence) {
  let odds = OFFSET;
  for (const [name, weight] of Object.entries(WEIGHTS)) odds += weight * evidence[name];
  return Math.min(1 / (1 + Math.exp(-odds)), (1 + leastAgreement(evidence)) / 2);
}

const leastAgreement = ({ mirrored, byBox, byClick, grey, darker }) => Math.min(mirrored, byBox, byClick, grey, darker);

/** What looks wrong, in a few words each, the gravest first. */
export function doubts(evidence) {
  return [
    [leastAgreement(evidence) - 0.6, "asked in another way, the network finds something else"],
    [evidence.edge - 0.45, "its outline does not follow the photo's edges"],
    [evidence.onePart - 0.8, "it falls into several parts"],
    [0.15 - evidence.border, "it is cut by the photo's border"],
    [0.9 - evidence.small, "it is very small"],
    [0.1 - evidence.large, "it covers nearly the whole photo"],
    [evidence.kept - 0.7, "the photo's colours contradict the network"],
  ]
    .filter(([margin]) => margin < 0)
    .sort(([a], [b]) => a - b)
    .map(([, words]) => words);
}

/** @returns {Promise<Evidence>} see qualityOf */
export async function examine(run, picture, cover, mask, hints) {
  const { width, height } = picture;
  const box = objectBox(mask, width);
  const window = around(box, width, height);
  const here = resize(cropOf(mask, width, window), 1, window.size, window.inner);
  const lookHere = async (on, corners) => iou((await look(run, picture, window, { on, off: [] }, corners)).values, here);
  const byBox = await lookHere([], box);
  const byClick = await lookHere([deepestPoint(mask, width)], null);
  const again = async (other, asked, turn = (values) => values) => {
    const found = await propose(run, other, asked);
    return iou(resize(turn(found.values, found.width), 1, [found.width, found.height], [width, height]), mask);
  };
  const flipped = { width, height, rgba: mirrored(picture.rgba, width, 4) };
  const inMirror = await again(flipped, mirroredHints(hints, width), mirrored);
  const grey = await again(mapped(picture, (r, g, b) => Array(3).fill(luminance(r, g, b))), hints);
  const darker = await again(mapped(picture, (...rgb) => rgb.map((value) => 255 * (value / 255) ** DARKER)), hints);
  const { part, loose } = oneObject(mask, width);
  const share = mask.reduce((count, value) => count + (value > 0.5 ? 1 : 0), 0) / mask.length;
  return {
    expected: cover.confidence,
    mirrored: inMirror,
    byBox,
    byClick,
    grey,
    darker,
    kept: iou(resize(cover.values, 1, [cover.width, cover.height], [width, height]), mask),
    onePart: 1 - loose,
    toldApart: colorsApart(picture, part),
    ...outlineOf(picture, mask, box),
    small: Math.log(Math.max(0.05 / Math.max(share, 1e-5), 1)),
    large: Math.max(share - 0.6, 0) / 0.4,
  };
}

/** The point of a mask that is furthest from everything outside, to a 64th of the longer side. */
export function deepestPoint(mask, width) {
  const height = mask.length / width;
  const step = Math.max(1, Math.round(Math.max(width, height) / 64));
  const start = Math.floor(step / 2);
  const [columns, rows] = [width, height].map((length) => Math.ceil((length - start) / step) + 2);
  let inside = new Uint8Array(columns * rows);
  for (let y = 0; y < rows - 2; y++) {
    for (let x = 0; x < columns - 2; x++) {
      if (mask[(start + y * step) * width + start + x * step] > 0.5) inside[(y + 1) * columns + x + 1] = 1;
    }
  }
  if (!inside.includes(1)) {
    const first = mask.findIndex((value) => value > 0.5);
    return [(first % width) + 0.5, Math.floor(first / width) + 0.5];
  }
  let last = inside;
  while (inside.includes(1)) {
    last = inside;
    inside = last.map((value, i) => value & last[i - 1] & last[i + 1] & last[i - columns] & last[i + columns]);
  }
  const deepest = [...last.keys()].filter((i) => last[i]).map((i) => [i % columns, Math.floor(i / columns)]);
  const mean = [0, 1].map((axis) => deepest.reduce((sum, point) => sum + point[axis], 0) / deepest.length);
  const away = deepest.map(([x, y]) => Math.hypot(y - mean[1], x - mean[0]));
  return deepest[away.indexOf(Math.min(...away))].map((at) => (at - 1) * step + start + 0.5);
}

function iou(one, other) {
  let [both, either] = [0, 0];
  for (let i = 0; i < one.length; i++) {
    const [a, b] = [one[i] > 0.5, other[i] > 0.5];
    if (a && b) both++;
    if (a || b) either++;
  }
  return both / Math.max(either, 1);
}

/** Values row by row, left to right. */
function mirrored(values, width, channels = 1) {
  const out = new values.constructor(values.length);
  const line = width * channels;
  for (let at = 0; at < values.length; at++) {
    const column = at % line;
    out[at] = values[at - column + (width - 1 - Math.floor(column / channels)) * channels + (column % channels)];
  }
  return out;
}

function mirroredHints({ on, off, box }, width) {
  const place = ([x, y]) => [width - x, y];
  return { on: on.map(place), off: off.map(place), box: box && [width - box[2], box[1], width - box[0], box[3]] };
}

/** The picture with other colours. */
function mapped({ width, height, rgba }, colorOf) {
  const out = new Float32Array(rgba.length);
  for (let at = 0; at < rgba.length; at += 4) out.set([...colorOf(rgba[at], rgba[at + 1], rgba[at + 2]), rgba[at + 3]], at);
  return { width, height, rgba: out };
}

function cropOf(values, width, { origin: [x, y], size: [w, h] }, channels = 1) {
  const out = new values.constructor(w * h * channels);
  for (let row = 0; row < h; row++) {
    const from = ((y + row) * width + x) * channels;
    out.set(values.subarray(from, from + w * channels), row * w * channels);
  }
  return out;
}

/** Share of the outline where the photo changes more than it mostly does nearby, and share on the border. */
function outlineOf({ width, height, rgba }, mask, [x0, y0, x1, y1]) {
  const more = 0.25 * Math.max(x1 - x0, y1 - y0);
  const left = Math.max(0, Math.floor(x0 - more));
  const top = Math.max(0, Math.floor(y0 - more));
  const size = [Math.min(width, Math.floor(x1 + more) + 1) - left, Math.min(height, Math.floor(y1 + more) + 1) - top];
  const scale = Math.min(1, WORK_PX / Math.max(...size));
  const small = size.map((length) => Math.max(4, Math.round(length * scale)));
  const window = { origin: [left, top], size };
  const picture = resize(cropOf(rgba, width, window, 4), 4, size, small);
  const inside = resize(cropOf(mask, width, window), 1, size, small).map((value) => (value > 0.5 ? 1 : 0));
  const change = changeOf(picture, small);
  const share = boxMean(inside, small, 1);
  const outline = share.map((value) => (value > 0.01 && value < 0.99 ? 1 : 0));
  const band = boxMean(outline, small, 5);
  const usual = median(change.filter((_, i) => band[i] > 0));
  const sharpest = boxMean(change, small, 1);
  let [sharp, all, atBorder] = [0, 0, 0];
  outline.forEach((value, i) => {
    all += value;
    if (value && sharpest[i] > 1.3 * usual) sharp++;
  });
  for (let x = 0; x < width; x++) atBorder += mask[x] + mask[mask.length - width + x];
  for (let at = 0; at < mask.length; at += width) atBorder += mask[at] + mask[at + width - 1];
  const around = 2 * (x1 - x0 + (y1 - y0));
  return { edge: all ? sharp / all : 0, border: Math.min(1, atBorder / Math.max(around, 1)) };
}

/** How much colours change around each pixel of [h, w, 4]: central differences, one-sided at the border. */
function changeOf(picture, [width, height]) {
  const change = new Float32Array(width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const ends = (at, most, step) => [(Math.max(at - 1, 0) - at) * step, (Math.min(at + 1, most - 1) - at) * step];
      let sum = 0;
      for (const [before, after] of [ends(x, width, 1), ends(y, height, width)]) {
        const reach = (after - before) / (Math.abs(before || after) || 1);
        const at = y * width + x;
        for (let c = 0; c < 3; c++) sum += ((picture[4 * (at + after) + c] - picture[4 * (at + before) + c]) / 255 / reach) ** 2;
      }
      change[y * width + x] = Math.sqrt(sum);
    }
  }
  return change;
}

/** Mean over the square of 2 reach + 1 pixels around each, of what of it is in the picture. */
function boxMean(values, [width, height], reach) {
  const along = (from, lines, length, line, step) => {
    const out = new Float64Array(from.length);
    const sums = new Float64Array(length + 1);
    for (let l = 0; l < lines; l++) {
      for (let i = 0; i < length; i++) sums[i + 1] = sums[i] + from[l * line + i * step];
      for (let i = 0; i < length; i++) {
        const [low, high] = [Math.max(i - reach, 0), Math.min(i + reach + 1, length)];
        out[l * line + i * step] = (sums[high] - sums[low]) / (high - low);
      }
    }
    return out;
  };
  return along(along(values, width, height, 1, width), height, width, width, 1);
}

function median(values) {
  if (!values.length) return 0;
  const sorted = values.slice().sort();
  const middle = Math.floor(sorted.length / 2);
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}
