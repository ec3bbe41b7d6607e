/**
 * Find the object of one picture, the key, in another one to a fraction of a pixel. A place p of the key lies at
 * W(p) = c + (x, y) + e^scale R(angle) (p - c), with c the mean of the mask's pixels. tests/product/cases/registration.json holds it
 * to known motions.
 *
 * @typedef {{width: number, height: number, values: Float32Array}} Luma a picture, or the window of one at an offset
 * @typedef {{x: number, y: number, angle: number, scale: number}} Motion pixels, radians clockwise, natural logarithm
 * @typedef {{motion: Motion, alike: number, inside: number, agreed: number, errorPx: number}} Registered
 */

import { solved } from "../core/linear.js";
import { median } from "../photo/ground.js";
import { objectBox } from "../photo/picture.js";
import { resize } from "../photo/resize.js";

const [FINE_PX, COARSE_PX, POINTS, PULL] = [384, 32, 3000, 0.05];
const [STEPS, DONE_PX, SPREAD, LEAST, LEAST_GAIN] = [8, 0.02, 2.4, 0.5, 0.2];
const [ALIKE, INSIDE, AGREED, ERROR] = [0.8, 0.7, 0.35, 3.0];

/** How far an object may move, in its longer sides. */
export const REACH = 0.25;

/** Numbers in a row of a level: what the four parts of a motion change, the key's value, one. */
const TERMS = 6;

/** No motion. @type {Motion} */
export const STILL = Object.freeze({ x: 0, y: 0, angle: 0, scale: 0 });

/** [a, b, c, d] of e^scale R(angle), row by row. @param {Motion} motion */
export function matrixOf({ angle, scale }) {
  const [cos, sin] = [Math.exp(scale) * Math.cos(angle), Math.exp(scale) * Math.sin(angle)];
  return [cos, -sin, sin, cos];
}

/** Whether a motion is to be believed. @param {Registered} found */
export const isSure = ({ alike, inside, agreed }) => alike >= ALIKE && inside >= INSIDE && agreed >= AGREED;

/** Luma (R + 2 G + B) / 4 of a window of a picture. @param {number[]} window x0, y0, x1, y1 in whole pixels @returns {Luma} */
export function lumaOf({ width, rgba }, [x0, y0, x1, y1]) {
  const values = new Float32Array((x1 - x0) * (y1 - y0));
  for (let y = y0, to = 0; y < y1; y++) {
    for (let at = 4 * (y * width + x0), end = 4 * (y * width + x1); at < end; at += 4) {
      values[to++] = (rgba[at] + 2 * rgba[at + 1] + rgba[at + 2]) / 4;
    }
  }
  return { width: x1 - x0, height: y1 - y0, values };
}

/**
 * The object's part of a picture.
 *
 * @param {Luma} picture
 * @param {Float32Array} mask cover of its object, of the picture's shape, not empty
 * @param {number[]} [offset] x, y of their first pixel in the frame
 */
export function beginKey(picture, mask, offset = [0, 0]) {
  const { center, radius, longer } = placeOf(mask, picture.width, offset);
  const [fine, coarse] = [FINE_PX, COARSE_PX].map((most) => Math.max(0, Math.ceil(Math.log2(longer / most))));
  const pictures = pyramid(smoothed(picture), coarse);
  const covers = pyramid({ ...picture, values: mask }, coarse);
  const levels = [];
  for (let level = fine; level <= coarse; level++) levels.push(levelOf(pictures[level], covers[level].values, level, offset, center, radius));
  return { center, radius, fine, coarse, levels, ...coarseBox(pictures[coarse], covers[coarse].values, coarse, offset, center) };
}

/**
 * Find a key's object in another picture, starting from a motion.
 *
 * @param {ReturnType<typeof beginKey>} key
 * @param {Luma} picture
 * @param {Motion} start
 * @param {number[]} [offset] as of beginKey
 * @returns {Registered}
 */
export function locateKey(key, picture, start, offset = [0, 0]) {
  const pictures = pyramid(smoothed(picture), key.coarse);
  let found = { motion: searched(key, pictures[key.coarse], start, offset), alike: 0, inside: 0, agreed: 0, errorPx: Infinity };
  for (let level = key.coarse; level >= key.fine; level--) {
    found = alignedTo(key, key.levels[level - key.fine], pictures[level], found.motion, level, offset);
    if (found.inside === 0) break;
  }
  return found;
}

/** Centre, radius and longer side of what a mask covers. */
function placeOf(mask, width, [left, top]) {
  let [count, sumX, sumY, squares] = [0, 0, 0, 0];
  for (let y = 0, i = 0; i < mask.length; y++) {
    for (let x = 0; x < width; x++, i++) {
      if (!(mask[i] > 0.5)) continue;
      count++;
      sumX += x;
      sumY += y;
      squares += x * x + y * y;
    }
  }
  const [x0, y0, x1, y1] = objectBox(mask, width);
  const [meanX, meanY] = [sumX / count, sumY / count];
  const radius = Math.sqrt(Math.max(squares / count - meanX ** 2 - meanY ** 2, 0)) || 1;
  return { center: [meanX + 0.5 + left, meanY + 0.5 + top], radius, longer: Math.max(x1 - x0, y1 - y0) };
}

/** Cells around the mask as far as it is searched, the place of their first from the centre; values of those covered, less their mean. */
function coarseBox({ width, values }, cover, coarse, first, center) {
  const most = cover.reduce((a, b) => Math.max(a, b), 0);
  const isIn = (value) => (most > 0.5 ? value > 0.5 : value >= most); // an object may be thinner than a cell
  const [x0, y0, x1, y1] = objectBox(cover.map(isIn), width);
  const reach = Math.ceil(REACH * Math.max(x1 - x0, y1 - y0));
  const [wide, high] = [x1 - x0 + 2 * reach, y1 - y0 + 2 * reach];
  const start = [x0 - reach, y0 - reach].map((cell, axis) => (cell + 0.5) * 2 ** coarse + first[axis] - center[axis]);
  const covered = [...cover.keys()].filter((at) => isIn(cover[at]));
  const mean = covered.reduce((sum, at) => sum + values[at], 0) / covered.length;
  const parts = Float64Array.from(covered, (at) => values[at] - mean);
  const at = Int32Array.from(covered, (cell) => (Math.floor(cell / width) - y0) * wide + (cell % width) - x0);
  return { wide, high, reach, start, parts, at, power: parts.reduce((sum, value) => sum + value * value, 0) };
}

/** Places and rows of a level's points. */
function levelOf({ width, height, values }, cover, level, [left, top], [cx, cy], radius) {
  const size = 2 ** (level + 1);
  let points = [];
  for (let y = 1; y < height - 1; y++) {
    for (let at = y * width + 1; at < (y + 1) * width - 1; at++) if (cover[at] > 0.5) points.push(at);
  }
  const slope = (at) => (values[at + 1] - values[at - 1]) ** 2 + (values[at + width] - values[at - width]) ** 2;
  if (points.length > POINTS) {
    const slopes = Float64Array.from(points, slope);
    const least = slopes.slice().sort()[points.length - POINTS];
    points = points.filter((_, i) => slopes[i] >= least).slice(0, POINTS);
  }
  const places = new Float64Array(2 * points.length);
  const rows = new Float64Array(TERMS * points.length);
  points.forEach((at, i) => {
    const u = ((at % width) + 0.5) * 2 ** level + left - cx;
    const v = (Math.floor(at / width) + 0.5) * 2 ** level + top - cy;
    const gx = (values[at + 1] - values[at - 1]) / size;
    const gy = (values[at + width] - values[at - width]) / size;
    places.set([u, v], 2 * i);
    rows.set([gx, gy, (gy * u - gx * v) / radius, (gx * u + gy * v) / radius, values[at], 1], TERMS * i);
  });
  return { count: points.length, places, rows };
}

/** The motion refined at one level. */
function alignedTo(key, { count, places, rows }, picture, motion, step, first) {
  const [values, left, sizes] = [0, 1, 2].map(() => new Float64Array(count));
  const weights = new Float64Array(count).fill(1);
  const there = new Uint8Array(count);
  let [moved, seen, gain, fit, normal] = [Infinity, 0, 1, null, null];
  for (let turn = 0; ; turn++) {
    seen = sample(picture, places, motion, key.center, first, 2 ** step, values, there);
    if (seen < TERMS) return { motion, alike: 0, inside: 0, agreed: 0, errorPx: Infinity };
    for (let i = 0; i < count; i++) weights[i] *= there[i];
    normal = normalOf(rows, values, weights);
    [fit] = solved(normal.matrix, [normal.right]);
    let known = 0;
    for (let i = 0, at = 0; i < count; i++, at += TERMS) {
      const moved = rows[at] * fit[0] + rows[at + 1] * fit[1] + rows[at + 2] * fit[2] + rows[at + 3] * fit[3];
      left[i] = values[i] - (moved + rows[at + 4] * fit[4] + fit[5]);
      if (there[i]) sizes[known++] = Math.abs(left[i]);
    }
    gain = Math.max(fit[4], LEAST_GAIN);
    if (turn === STEPS || moved <= DONE_PX * 2 ** step) break;
    const reach = SPREAD * Math.max(1.4826 * median(sizes.subarray(0, known)), LEAST);
    const delta = [0, 1, 2, 3].map((term) => fit[term] / gain);
    moved = Math.hypot(delta[0], delta[1]) + Math.hypot(delta[2], delta[3]);
    motion = composed(motion, delta, key.radius);
    for (let i = 0; i < count; i++) weights[i] = 1 / (1 + (left[i] / reach) ** 2);
  }
  const { alike, total, squares } = judged(values, left, weights);
  const units = [0, 1, 2, 3].map((axis) => Array.from({ length: TERMS }, (_, i) => (i === axis ? 1 : 0)));
  const trace = solved(normal.matrix, units).reduce((sum, column, axis) => sum + column[axis], 0);
  const errorPx = (ERROR * Math.sqrt((trace * squares) / total)) / gain;
  return { motion, alike: fit[4] > 0 ? alike : 0, inside: seen / count, agreed: total / seen, errorPx };
}

/** Weighted correlation of values and what a fit with a constant term leaves of them, the sum of the weights, and of the squares left. */
function judged(values, left, weights) {
  let [total, sum, whole, squares] = [0, 0, 0, 0];
  for (let i = 0; i < values.length; i++) {
    total += weights[i];
    sum += weights[i] * values[i];
    whole += weights[i] * values[i] * values[i];
    squares += weights[i] * left[i] * left[i];
  }
  const spread = whole - (sum * sum) / total;
  return { alike: Math.sqrt(Math.max(1 - squares / Math.max(spread, 1e-12), 0)), total, squares };
}

/** The normal equations of weighted rows: matrix [6][6] and right side [6]. */
function normalOf(rows, values, weights) {
  const [matrix, right] = [[], []];
  for (let term = 0; term < TERMS; term++) {
    let s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0, s4 = 0.0, s5 = 0.0, sum = 0.0;
    for (let i = 0, at = 0; i < values.length; i++, at += TERMS) {
      const part = weights[i] * rows[at + term];
      s0 += part * rows[at];
      s1 += part * rows[at + 1];
      s2 += part * rows[at + 2];
      s3 += part * rows[at + 3];
      s4 += part * rows[at + 4];
      s5 += part * rows[at + 5];
      sum += part * values[i];
    }
    matrix.push([s0, s1, s2, s3, s4, s5]);
    right.push(sum);
  }
  const trace = matrix.reduce((sum, line, a) => sum + line[a], 0);
  matrix.forEach((line, a) => (line[a] += 1e-9 * trace + 1e-12));
  return { matrix, right };
}

/** W o Delta^-1. @param {number[]} delta */
function composed({ x, y, angle, scale }, [dx, dy, turn, growth], radius) {
  const turned = { angle: angle - turn / radius, scale: scale - growth / radius };
  const [a, b, c, d] = matrixOf(turned);
  return { x: x - (a * dx + b * dy), y: y - (c * dx + d * dy), ...turned };
}

/** The start shifted by whole cells of the coarse level to the object's most likely place. */
function searched({ wide, high, reach, start: begin, parts, at, power, coarse, center }, picture, start, first) {
  const cell = 2 ** coarse;
  const places = new Float64Array(2 * wide * high);
  for (let i = 0; i < wide * high; i++) {
    places[2 * i] = (i % wide) * cell + begin[0];
    places[2 * i + 1] = Math.floor(i / wide) * cell + begin[1];
  }
  const seen = new Float64Array(wide * high);
  const there = new Uint8Array(wide * high);
  sample(picture, places, start, center, first, cell, seen, there);
  const covered = parts.length;
  let [best, likeliest] = [[0, 0], -Infinity];
  for (let dy = -reach; dy <= reach; dy++) {
    for (let dx = -reach; dx <= reach; dx++) {
      const shift = (dy + reach) * wide + dx + reach;
      let agree = 0;
      let total = 0;
      let square = 0;
      let known = 0;
      for (let i = 0; i < covered; i++) {
        const place = at[i] + shift;
        const value = seen[place];
        agree += value * parts[i];
        total += value;
        square += value * value;
        known += there[place];
      }
      const spread = Math.sqrt(Math.max(square - total ** 2 / covered, 1e-6) * Math.max(power, 1e-6));
      const alike = (known / covered >= INSIDE ? agree / spread : -1) - (PULL * (dx * dx + dy * dy)) / reach ** 2;
      if (alike > likeliest) [best, likeliest] = [[dx, dy], alike];
    }
  }
  const [a, b, c, d] = matrixOf(start);
  const [x, y] = best.map((cells) => cells * cell);
  return { ...start, x: start.x + a * x + b * y, y: start.y + c * x + d * y };
}

/**
 * Values of a picture's level at moved places, by linear interpolation.
 *
 * @param {Float64Array} places x, y from the centre
 * @param {number} cell pixels of the level, of the frame's
 * @param {Float64Array} values written: of places beside the picture that of its nearest pixel
 * @param {Uint8Array} there written: 1 where a place is in the picture
 * @returns {number} how many are
 */
export function sample({ width, height, values: pixels }, places, motion, [cx, cy], [left, top], cell, values, there) {
  const [a, b, c, d] = matrixOf(motion);
  const [right, below] = [Math.min(1, width - 1), width * Math.min(1, height - 1)];
  let count = 0;
  for (let i = 0; i < values.length; i++) {
    const [u, v] = [places[2 * i], places[2 * i + 1]];
    let x = (a * u + b * v + cx + motion.x - left) / cell - 0.5;
    let y = (c * u + d * v + cy + motion.y - top) / cell - 0.5;
    there[i] = x >= 0 && x <= width - 1 && y >= 0 && y <= height - 1 ? 1 : 0;
    count += there[i];
    x = Math.min(Math.max(x, 0), width - 1);
    y = Math.min(Math.max(y, 0), height - 1);
    const [column, row] = [Math.min(Math.floor(x), Math.max(width - 2, 0)), Math.min(Math.floor(y), Math.max(height - 2, 0))];
    x -= column;
    y -= row;
    const at = row * width + column;
    const above = pixels[at] * (1 - x) + pixels[at + right] * x;
    values[i] = above * (1 - y) + (pixels[at + below] * (1 - x) + pixels[at + below + right] * x) * y;
  }
  return count;
}

/** [1 2 1] / 4 along rows, then columns, the border repeated. @param {Luma} picture */
function smoothed({ width, height, values }) {
  const [along, out] = [new Float32Array(values.length), new Float32Array(values.length)];
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i++) {
      along[i] = (values[x ? i - 1 : i] + values[x < width - 1 ? i + 1 : i] + 2 * values[i]) / 4;
    }
  }
  for (let y = 0, i = 0; y < height; y++) {
    const [up, down] = [y ? -width : 0, y < height - 1 ? width : 0];
    for (let x = 0; x < width; x++, i++) out[i] = (along[i + up] + along[i + down] + 2 * along[i]) / 4;
  }
  return { width, height, values: out };
}

/** A picture, halved so many times. */
function pyramid(picture, coarse) {
  const levels = [picture];
  for (let level = 0; level < coarse; level++) {
    const { width, height, values } = levels[level];
    const [w, h] = [width >> 1, height >> 1];
    levels.push({ width: w, height: h, values: resize(values, 1, [width, height], [w, h], [0, 0, 2 * w, 2 * h]) });
  }
  return levels;
}
