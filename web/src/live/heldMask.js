/**
 * Hold an object's mask in the picture in which it was found, and move it with the object to later frames. While it is
 * followed it is not searched again: each search finds a slightly different mask, and the light would drift with it. Every
 * function returns a new state and leaves the given one unchanged.
 *
 * @typedef {import("../photo/picture.js").Picture} Picture
 * @typedef {ReturnType<typeof hold>} Held
 */

import { CONTRACT } from "../core/contract.js";
import { median } from "../photo/ground.js";
import { objectBox } from "../photo/picture.js";
import { around } from "../photo/search.js";
import { REACH, STILL, beginKey, locateKey, lumaOf, matrixOf, sample } from "./registration.js";

const { most_change: MOST_CHANGE, faded: FADED, room: ROOM, remembered: REMEMBERED, other_light: OTHER_LIGHT, ...NUMBERS } = CONTRACT.held_mask;
const { narrow: NARROW, narrow_error: NARROW_ERROR, narrow_most: NARROW_MOST } = NUMBERS;

/** Margin read beyond the reach of registration, in longer sides of the object. */
const READ_MORE = REACH + 0.1;

/** Smaller windows are not registered, and so far a mask's soft edge reaches beyond it [pixels]. */
const [LEAST_PX, SOFT_PX] = [8, 2];

/** A mask that was found in a frame. @param {Picture} picture @param {Float32Array} mask of the picture's size, not empty */
export function hold(picture, mask) {
  const window = around([0, 0, picture.width, picture.height], objectBox(mask, picture.width), ROOM);
  const [x0, y0, x1, y1] = window;
  const [width, height] = [x1 - x0, y1 - y0];
  const cover = new Float32Array(width * height);
  for (let y = y0; y < y1; y++) cover.set(mask.subarray(y * picture.width + x0, y * picture.width + x1), (y - y0) * width);
  const key = beginKey(lumaOf(picture, window), cover, [x0, y0]);
  return { key, cover, width, height, offset: [x0, y0], size: [picture.width, picture.height], motion: STILL, errorPx: 0, unlike: [], looksSame: false };
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

/** After one more frame, in which the object was found for sure. @param {Held} before @param {Picture} picture */
export function follow(before, picture, { motion, errorPx, alike }) {
  const usual = before.unlike.length ? median(before.unlike) : 1 - alike;
  const unlike = [...before.unlike, 1 - alike].slice(-REMEMBERED);
  const now = { errorPx, unlike, looksSame: isLike(1 - alike, usual) };
  const held = { ...before, motion, ...now };
  return alike >= FADED ? held : { ...hold(picture, maskIn(held)), ...now };
}

/** Whether two counts of pixels may be of one object. */
export const isOneObject = (count, before) => count / before > 1 / MOST_CHANGE && count / before < MOST_CHANGE;

/** The mask in the last frame, of its size; another cover of the key's. @param {Held} held */
export function maskIn(held, cover = held.cover) {
  const { motion, key: { center }, offset, size: [width, height] } = held;
  const more = [-SOFT_PX, -SOFT_PX, SOFT_PX, SOFT_PX];
  const [x0, y0, x1, y1] = around([0, 0, width, height], boxOf(held).map((at, i) => at + more[i]), 0);
  const [across, count] = [x1 - x0, Math.max(x1 - x0, 0) * Math.max(y1 - y0, 0)];
  const places = new Float64Array(2 * count);
  for (let i = 0; i < count; i++) {
    places[2 * i] = x0 + (i % across) + 0.5 - center[0] - motion.x;
    places[2 * i + 1] = y0 + Math.floor(i / across) + 0.5 - center[1] - motion.y;
  }
  const [values, there] = [new Float64Array(count), new Uint8Array(count)];
  const back = { x: 0, y: 0, angle: -motion.angle, scale: -motion.scale };
  sample({ width: held.width, height: held.height, values: cover }, places, back, center, offset, 1, values, there);
  const mask = new Float32Array(width * height);
  for (let i = 0; i < count; i++) mask[(y0 + Math.floor(i / across)) * width + x0 + (i % across)] = values[i] * there[i];
  return mask;
}

/** The mask in the last frame as the light is to be estimated by. @param {Held} held */
export function litMask(held) {
  const [x0, y0, x1, y1] = objectBox(held.cover, held.width);
  const narrow = NARROW * Math.max(x1 - x0, y1 - y0) + NARROW_ERROR * held.errorPx;
  const cover = narrowed(held.cover, held.width, Math.min(narrow, NARROW_MOST));
  return maskIn(held, cover.some((value) => value > 0.5) ? cover : held.cover);
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

/** Minimum of each pixel and its four neighbours, zero outside the cover. */
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

/** Around the object in the last frame, x0, y0, x1, y1. */
function boxOf({ cover, width, offset, key, motion }) {
  const box = objectBox(cover, width);
  const [a, b, c, d] = matrixOf(motion);
  const [cx, cy] = key.center;
  const places = [[0, 1], [2, 1], [0, 3], [2, 3]].map(([i, j]) => {
    const [u, v] = [box[i] + offset[0] - cx, box[j] + offset[1] - cy];
    return [cx + motion.x + a * u + b * v, cy + motion.y + c * u + d * v];
  });
  const [across, down] = [0, 1].map((axis) => places.map((place) => place[axis]));
  return [Math.min(...across), Math.min(...down), Math.max(...across), Math.max(...down)];
}
