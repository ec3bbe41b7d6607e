/**
 * An object's mask, held in the picture in which it was found and moved with the object to each further frame:
 * anyprobe.video.held_mask, where the rules stand. Every function gives a new state and leaves the one given as it is.
 *
 * @typedef {import("../photo/picture.js").Picture} Picture
 * @typedef {ReturnType<typeof hold>} Held
 */

import { CONTRACT } from "../core/contract.js";
import { median } from "../photo/ground.js";
import { objectBox } from "../photo/picture.js";
import { around } from "../photo/search.js";
import { STILL, beginKey, locateKey, lumaOf, matrixOf } from "./registration.js";

const { every: EVERY, every_sure: EVERY_SURE, every_refused: EVERY_REFUSED, ...NUMBERS } = CONTRACT.held_mask;
const { patience: PATIENCE, agrees: AGREES, most: MOST } = NUMBERS;
const { most_change: MOST_CHANGE, faded: FADED, room: ROOM, remembered: REMEMBERED, other_light: OTHER_LIGHT } = NUMBERS;
const { narrow: NARROW, narrow_error: NARROW_ERROR, narrow_most: NARROW_MOST } = NUMBERS;

/** Of what the search of a registration reaches, in longer sides of the object, so much more is read. */
const READ_MORE = CONTRACT.registration.reach + 0.1;

/** Shorter windows show nothing to register. */
const LEAST_PX = 8;

/**
 * A mask that was found in a frame.
 *
 * @param {Picture} picture
 * @param {Float32Array} mask of the picture's size, not empty
 */
export function hold(picture, mask, finds = 1) {
  const window = around([0, 0, picture.width, picture.height], objectBox(mask, picture.width), ROOM);
  const [x0, y0, x1, y1] = window;
  const [width, height] = [x1 - x0, y1 - y0];
  const cover = new Float32Array(width * height);
  for (let y = y0; y < y1; y++) cover.set(mask.subarray(y * picture.width + x0, y * picture.width + x1), (y - y0) * width);
  const key = beginKey(lumaOf(picture, window), cover, [x0, y0]);
  return { key, cover, width, height, offset: [x0, y0], size: [picture.width, picture.height], finds, motion: STILL, errorPx: 0, age: 0, refused: 0, other: null, unlike: [], looksSame: false };
}

/** Where the object lies in another frame, looked for around where it was last. @param {Held} held @param {Picture} picture */
export function foundIn(held, picture) {
  const [x0, y0, x1, y1] = boxOf(held);
  const more = READ_MORE * Math.max(x1 - x0, y1 - y0);
  const window = around([0, 0, ...held.size], [x0 - more, y0 - more, x1 + more, y1 + more], 0);
  if (window[2] - window[0] < LEAST_PX || window[3] - window[1] < LEAST_PX) {
    return { motion: held.motion, alike: 0, inside: 0, agreed: 0, errorPx: Infinity };
  }
  return locateKey(held.key, lumaOf(picture, window), held.motion, window);
}

/** Of 1 - alike: it rises where the light changes, and falls where it changes back to that of the key. */
const isLike = (one, other) => Math.max(one, other) <= OTHER_LIGHT.times * Math.min(one, other) + OTHER_LIGHT.more;

/**
 * After one more frame, in which the object was found for sure.
 *
 * @param {Held} before
 * @param {Picture} picture
 * @param {import("./registration.js").Registered} found
 * @param {((mask: Float32Array) => Promise<Float32Array | null>) | null} find a mask of the frame, given where it is now
 * @returns {Promise<Held>}
 */
export async function follow(before, picture, found, find) {
  const usual = before.unlike.length ? median(before.unlike) : 1 - found.alike;
  const unlike = [...before.unlike, 1 - found.alike].slice(-REMEMBERED);
  const looksSame = isLike(1 - found.alike, usual);
  let held = { ...before, motion: found.motion, errorPx: found.errorPx, age: before.age + 1, unlike, looksSame };
  const every = held.refused ? EVERY_REFUSED : Math.min(EVERY * 2 ** (held.finds - 1), EVERY_SURE);
  if (find && held.age >= every) held = looked(held, picture, await find(maskIn(held)));
  if (found.alike >= FADED) return held;
  const newer = hold(picture, maskIn(held), held.finds);
  const { errorPx, age, refused, other } = held;
  return { ...newer, errorPx, age, refused, unlike: held.unlike, looksSame: held.looksSame, other: other && carried(held, other, newer) };
}

/** Whether two counts of pixels are of one object. */
export const isOneObject = (count, before) => count / before > 1 / MOST_CHANGE && count / before < MOST_CHANGE;

/** After a mask was looked for. */
function looked(before, picture, mask) {
  const held = { ...before, age: 0 };
  if (!mask) return held;
  const there = inKey(held, mask);
  if (!isOneObject(sum(there), sum(held.cover))) return held;
  if (overlap(held.cover, there) >= AGREES) {
    const share = 1 / Math.min(held.finds + 1, MOST);
    const cover = held.cover.map((value, i) => value + share * (there[i] - value));
    return { ...held, cover, finds: held.finds + 1, refused: 0, other: null };
  }
  const refused = held.other && overlap(held.other, there) >= AGREES ? held.refused + 1 : 1;
  return refused >= PATIENCE ? hold(picture, mask) : { ...held, refused, other: there };
}

/** The mask in the last frame, of its size; another cover of the key's. @param {Held} held */
export function maskIn(held, cover = held.cover) {
  const [width, height] = held.size;
  const mask = new Float32Array(width * height);
  const [x0, y0, x1, y1] = boxOf(held).map(Math.round);
  const { motion, key, offset } = held;
  const [cx, cy] = key.center;
  const [a, b, c, d] = matrixOf({ angle: -motion.angle, scale: -motion.scale });
  const [left, right] = [Math.max(x0 - 2, 0), Math.min(x1 + 2, width)];
  const line = held.width;
  const [moreX, moreY] = [cx - offset[0] - 0.5, cy - offset[1] - 0.5];
  for (let y = Math.max(y0 - 2, 0); y < Math.min(y1 + 2, height); y++) {
    const v = y + 0.5 - cy - motion.y;
    const [startX, startY] = [b * v + moreX, d * v + moreY];
    for (let x = left, to = y * width + left; x < right; x++, to++) {
      const u = x + 0.5 - cx - motion.x;
      const fromX = a * u + startX;
      const fromY = c * u + startY;
      if (!(fromX >= 0 && fromX < line - 1 && fromY >= 0 && fromY < held.height - 1)) {
        mask[to] = valueAt(cover, line, held.height, fromX, fromY);
        continue;
      }
      const at = Math.floor(fromY) * line + Math.floor(fromX);
      const beside = fromX - Math.floor(fromX);
      const above = cover[at] * (1 - beside) + cover[at + 1] * beside;
      const below = cover[at + line] * (1 - beside) + cover[at + line + 1] * beside;
      mask[to] = above + (fromY - Math.floor(fromY)) * (below - above);
    }
  }
  return mask;
}

/** The mask in the last frame as the light is to be estimated by. @param {Held} held */
export function litMask(held) {
  const [x0, y0, x1, y1] = coverBox(held.cover, held.width);
  const narrow = NARROW * Math.max(x1 - x0, y1 - y0) + NARROW_ERROR * held.errorPx;
  const cover = narrowed(held.cover, held.width, Math.min(narrow, NARROW_MOST));
  return maskIn(held, cover.some((value) => value > 0.5) ? cover : held.cover);
}

const boxes = new WeakMap();

/** Around what a cover of the key covers, found once. */
function coverBox(cover, width) {
  if (!boxes.has(cover)) boxes.set(cover, objectBox(cover, width));
  return boxes.get(cover);
}

/** A cover whose edge lies so many pixels further inside. */
export function narrowed(cover, width, pixels) {
  const whole = Math.floor(pixels);
  for (let i = 0; i < whole; i++) cover = leastOf(cover, width);
  const part = pixels - whole;
  if (part === 0) return cover;
  const next = leastOf(cover, width);
  const out = new Float32Array(cover.length);
  for (let i = 0; i < out.length; i++) out[i] = cover[i] + part * (next[i] - cover[i]);
  return out;
}

const leasts = new WeakMap();

/** The least of each pixel and its four neighbours, found once; beside the cover is nothing. */
function leastOf(cover, width) {
  if (leasts.has(cover)) return leasts.get(cover);
  const out = new Float32Array(cover.length);
  for (let row = width; row < cover.length - width; row += width) {
    for (let i = row + 1; i < row + width - 1; i++) {
      if (cover[i] === 0) continue;
      out[i] = Math.min(cover[i], cover[i - 1], cover[i + 1], cover[i - width], cover[i + width]);
    }
  }
  leasts.set(cover, out);
  return out;
}

/** A mask of the last frame in the key's window. */
function inKey({ key, motion, offset, width, height, size }, mask) {
  const [a, b, c, d] = matrixOf(motion);
  const [cx, cy] = key.center;
  const out = new Float32Array(width * height);
  for (let i = 0; i < out.length; i++) {
    const [u, v] = [(i % width) + 0.5 + offset[0] - cx, Math.floor(i / width) + 0.5 + offset[1] - cy];
    out[i] = valueAt(mask, ...size, a * u + b * v + cx + motion.x - 0.5, c * u + d * v + cy + motion.y - 0.5);
  }
  return out;
}

/** A cover of one key's window in that of the frame which it was last moved to. */
function carried(held, cover, to) {
  const mask = maskIn(held, cover);
  const [x0, y0] = to.offset;
  const out = new Float32Array(to.width * to.height);
  for (let y = 0; y < to.height; y++) {
    const from = (y + y0) * held.size[0] + x0;
    out.set(mask.subarray(from, from + to.width), y * to.width);
  }
  return out;
}

/** Linear between pixels, of which 0 is the first one's centre; 0 beside them. */
function valueAt(values, width, height, x, y) {
  if (!(x >= 0 && x <= width - 1 && y >= 0 && y <= height - 1)) return 0;
  const [left, top] = [Math.min(Math.floor(x), Math.max(width - 2, 0)), Math.min(Math.floor(y), Math.max(height - 2, 0))];
  const [right, below] = [x - left, y - top];
  const at = top * width + left;
  const [beside, under] = [Math.min(1, width - 1), width * Math.min(1, height - 1)];
  const above = values[at] * (1 - right) + values[at + beside] * right;
  return above * (1 - below) + (values[at + under] * (1 - right) + values[at + under + beside] * right) * below;
}

/** Around the object in the last frame, x0, y0, x1, y1. */
function boxOf({ cover, width, offset, key, motion }) {
  const box = coverBox(cover, width);
  const [a, b, c, d] = matrixOf(motion);
  const [cx, cy] = key.center;
  const places = [[0, 1], [2, 1], [0, 3], [2, 3]].map(([i, j]) => {
    const [u, v] = [box[i] + offset[0] - cx, box[j] + offset[1] - cy];
    return [cx + motion.x + a * u + b * v, cy + motion.y + c * u + d * v];
  });
  const [across, down] = [0, 1].map((axis) => places.map((place) => place[axis]));
  return [Math.min(...across), Math.min(...down), Math.max(...across), Math.max(...down)];
}

function sum(values) {
  let total = 0;
  for (const value of values) total += value;
  return total;
}

function overlap(one, other) {
  let [both, either] = [0, 0];
  for (let i = 0; i < one.length; i++) {
    const [a, b] = [one[i] > 0.5, other[i] > 0.5];
    if (a && b) both++;
    if (a || b) either++;
  }
  return both / Math.max(either, 1);
}
