/**
 * How good a found mask is, as anyprobe.masks.quality: what the network expects of it, whether other ways to ask give the
 * same object, and whether what lies beside it looks like it.
 */

import { colorOdds, colorsApart } from "./colorsApart.js";
import { oneObject } from "./parts.js";
import { objectBox } from "./picture.js";
import { propose } from "./propose.js";
import { resize } from "./resize.js";

/** Expected IoU below which a mask comes with a warning. */
export const DOUBTFUL = 0.81;

const OFFSET = -10.61;
/** Of the log-odds of the IoU. */
const WEIGHTS = {
  expected: 3.54,
  mirrored: 2.57,
  darker: 0.63,
  kept: 2.35,
  toldApart: 2.53,
  apart: 1.87,
  edge: 0.73,
};
/** Power of the display values of the picture that is asked about again, exposed less. */
const DARKER = 1.8;
/** What counts as just outside a mask, from and to, and as surroundings, in pixels of WORK_PX. */
const BESIDE = [2, 6];
const FAR_PX = 7;
/** Longer side at which edges and what lies on their sides are compared. */
const WORK_PX = 160;
/** Of WORK_PX that colours are compared on. */
const LEAST_PX = 20;

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

/** By WEIGHTS. */
export function expectedIou(evidence) {
  let odds = OFFSET;
  for (const [name, weight] of Object.entries(WEIGHTS)) odds += weight * evidence[name];
  return 1 / (1 + Math.exp(-odds));
}

/** What looks wrong, in a few words each, the gravest first. */
export function doubts(evidence) {
  return [
    [Math.min(evidence.mirrored, evidence.darker) - 0.6, "asked in another way, the network finds something else"],
    [evidence.apart - 0.75, "what lies beside it has the same colours"],
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
  const again = async (other, asked, turn = (values) => values) => {
    const found = await propose(run, other, asked);
    return iou(resize(turn(found.values, found.width), 1, [found.width, found.height], [width, height]), mask);
  };
  const flipped = { width, height, rgba: mirrored(picture.rgba, width, 4) };
  const inMirror = await again(flipped, mirroredHints(hints, width), mirrored);
  const darker = await again(lessExposed(picture), hints);
  const { part, loose } = oneObject(mask, width);
  const share = mask.reduce((count, value) => count + (value > 0.5 ? 1 : 0), 0) / mask.length;
  return {
    expected: cover.confidence,
    mirrored: inMirror,
    darker,
    kept: iou(resize(cover.values, 1, [cover.width, cover.height], [width, height]), mask),
    onePart: 1 - loose,
    toldApart: colorsApart(picture, part),
    apart: apartFrom(picture, mask, box),
    ...outlineOf(picture, mask, box),
    small: Math.log(Math.max(0.05 / Math.max(share, 1e-5), 1)),
    large: Math.max(share - 0.6, 0) / 0.4,
  };
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

/** The picture by DARKER. */
function lessExposed({ width, height, rgba }) {
  return { width, height, rgba: Float32Array.from(rgba, (value, at) => (at % 4 === 3 ? value : 255 * (value / 255) ** DARKER)) };
}

function cropOf(values, width, { origin: [x, y], size: [w, h] }, channels = 1) {
  const out = new values.constructor(w * h * channels);
  for (let row = 0; row < h; row++) {
    const from = ((y + row) * width + x) * channels;
    out.set(values.subarray(from, from + w * channels), row * w * channels);
  }
  return out;
}

/** Picture and mask (1 inside) around the object, with more of its longer side, at most WORK_PX across. */
function aroundObject({ width, height, rgba }, mask, [x0, y0, x1, y1], share) {
  const more = share * Math.max(x1 - x0, y1 - y0);
  const left = Math.max(0, Math.floor(x0 - more));
  const top = Math.max(0, Math.floor(y0 - more));
  const size = [Math.min(width, Math.floor(x1 + more) + 1) - left, Math.min(height, Math.floor(y1 + more) + 1) - top];
  const scale = Math.min(1, WORK_PX / Math.max(...size));
  const small = size.map((length) => Math.max(4, Math.round(length * scale)));
  const window = { origin: [left, top], size };
  const picture = resize(cropOf(rgba, width, window, 4), 4, size, small);
  const inside = resize(cropOf(mask, width, window), 1, size, small).map((value) => (value > 0.5 ? 1 : 0));
  return { picture, inside, small };
}

/**
 * Mean probability, by colour alone, that what lies just outside a mask is surroundings and not object: a part of an
 * object, and a mask that ran over into its surroundings, have their own colours beside them.
 */
function apartFrom(photo, mask, box) {
  const { picture, inside, small } = aroundObject(photo, mask, box, 0.35);
  const grown = [inside];
  while (grown.length <= FAR_PX) grown.push(grow(grown.at(-1), small));
  const [from, to] = BESIDE.map((px) => grown[px]);
  const beside = to.map((value, i) => value - from[i]);
  const not = (values) => values.map((value) => 1 - value);
  const core = not(grow(grow(not(inside), small), small));
  const count = (values) => values.reduce((sum, value) => sum + value, 0);
  const beyond = not(grown[FAR_PX]);
  const far = count(beyond) >= LEAST_PX ? beyond : not(from);
  if (Math.min(count(core), count(far), count(beside)) < LEAST_PX) return 0.5;
  const colors = Float64Array.from({ length: 3 * inside.length }, (_, i) => picture[4 * Math.floor(i / 3) + (i % 3)] / 255);
  const odds = colorOdds(colors, core, far);
  return beside.reduce((sum, value, i) => sum + value / (1 + Math.exp(odds[i])), 0) / count(beside);
}

/** What is inside, 1, and the pixels beside it. */
function grow(inside, [width, height]) {
  return inside.map((value, i) => {
    const [x, y] = [i % width, Math.floor(i / width)];
    const isBeside = (x > 0 && inside[i - 1]) || (x < width - 1 && inside[i + 1]) || (y > 0 && inside[i - width]) || (y < height - 1 && inside[i + width]);
    return value || isBeside ? 1 : 0;
  });
}

/** Share of the outline where the photo changes more than it mostly does nearby, and share on the border. */
function outlineOf(photo, mask, box) {
  const { width } = photo;
  const { picture, inside, small } = aroundObject(photo, mask, box, 0.25);
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
  const around = 2 * (box[2] - box[0] + (box[3] - box[1]));
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
