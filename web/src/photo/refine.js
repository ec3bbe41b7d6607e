/**
 * A coarse mask brought to the photo's own edges: the guided filter of He, Sun and Tang (ECCV 2010),
 * as anyprobe.masks.refine.
 */

import { resize } from "./resize.js";

const LONG_PX = 640;
const RADIUS = 1 / 80;
const EPSILON = 1e-4;
const STEEPNESS = 2;
const PAIRS = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

/**
 * @param {import("./picture.js").Picture} picture
 * @param {import("./propose.js").Cover} cover
 * @returns {Float32Array} a mask of the picture
 */
export function refine({ width, height, rgba }, cover) {
  const count = width * height;
  const rgb = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) for (let c = 0; c < 3; c++) rgb[3 * i + c] = rgba[4 * i + c] / 255;
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  const small = [width, height].map((length) => Math.max(1, Math.round(length * scale)));
  const guide = resize(rgb, 3, [width, height], small);
  const target = resize(cover.values, 1, [cover.width, cover.height], small);
  const reach = Math.max(1, Math.round(RADIUS * Math.max(...small)));
  const lines = resize(fit(guide, target, small, reach), 4, small, [width, height]);
  return Float32Array.from({ length: count }, (_, i) => {
    const fitted =
      lines[4 * i] * rgb[3 * i] +
      lines[4 * i + 1] * rgb[3 * i + 1] +
      lines[4 * i + 2] * rgb[3 * i + 2] +
      lines[4 * i + 3];
    return Math.min(Math.max((fitted - 0.5) * STEEPNESS + 0.5, 0), 1);
  });
}

/** Slope and offset [h, w, 4] of the linear fits of all windows over each pixel, averaged. */
function fit(guide, target, size, reach) {
  const count = size[0] * size[1];
  const terms = new Float64Array(13 * count); // guide, target, products of guide, guide times target
  for (let i = 0; i < count; i++) {
    const g = guide.subarray(3 * i, 3 * i + 3);
    const t = target[i];
    terms.set([...g, t, ...PAIRS.map(([a, b]) => g[a] * g[b]), g[0] * t, g[1] * t, g[2] * t], 13 * i);
  }
  const mean = boxMean(terms, 13, size, reach);
  const lines = new Float64Array(4 * count);
  for (let i = 0; i < count; i++) {
    const m = mean.subarray(13 * i, 13 * i + 13);
    const spread = PAIRS.map(([a, b], k) => m[4 + k] - m[a] * m[b] + (a === b ? EPSILON : 0));
    const slope = solve(spread, [0, 1, 2].map((c) => m[10 + c] - m[c] * m[3]));
    lines.set([...slope, m[3] - slope[0] * m[0] - slope[1] * m[1] - slope[2] * m[2]], 4 * i);
  }
  return boxMean(lines, 4, size, reach);
}

/** x of a symmetric 3 x 3 system, by cofactors. */
function solve([a, b, c, d, e, f], [x, y, z]) {
  const [aa, ab, ac] = [d * f - e * e, c * e - b * f, b * e - c * d];
  const [bb, bc, cc] = [a * f - c * c, b * c - a * e, a * d - b * b];
  const determinant = a * aa + b * ab + c * ac;
  return [aa * x + ab * y + ac * z, ab * x + bb * y + bc * z, ac * x + bc * y + cc * z].map(
    (value) => value / determinant,
  );
}

/** Mean over the square of 2 reach + 1 pixels around each, of what of it is in the picture. */
function boxMean(values, channels, [width, height], reach) {
  const rows = runningMean(values, height, width, channels, width * channels, channels, reach);
  return runningMean(rows, width, height, channels, channels, width * channels, reach);
}

/** Along one axis: `lines` lines, each of `length` steps. */
function runningMean(values, lines, length, channels, lineStep, step, reach) {
  const out = new Float64Array(values.length);
  for (let line = 0; line < lines; line++) {
    for (let c = 0; c < channels; c++) {
      const start = line * lineStep + c;
      let sum = 0;
      for (let i = 0; i < Math.min(reach, length); i++) sum += values[start + i * step];
      for (let i = 0; i < length; i++) {
        if (i + reach < length) sum += values[start + (i + reach) * step];
        if (i - reach - 1 >= 0) sum -= values[start + (i - reach - 1) * step];
        out[start + i * step] = sum / (Math.min(i + reach + 1, length) - Math.max(i - reach, 0));
      }
    }
  }
  return out;
}
