/** How well colours tell an object from what is beside it, as anyprobe.masks.cut measures it for other masks than its own. */

import { resize } from "./resize.js";

/** Longer side at which colours are compared. */
const LONG_PX = 448;
/** Gaussians of either side, rounds of clustering, and pixels that they are fitted to. */
const COLORS = 5;
const ROUNDS = 4;
const SAMPLES = 12_000;
/** Of display values within one Gaussian. */
const LEAST_VARIANCE = 2e-4;
/** Of a colour that no Gaussian expects. */
const EVEN = 1e-2;

/**
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} part 1 on the object
 * @returns {number} 0 where colours are no better than a coin, 1 where they agree with the mask everywhere
 */
export function colorsApart({ width, height, rgba }, part) {
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  const size = [width, height].map((length) => Math.max(1, Math.round(length * scale)));
  const small = resize(rgba, 4, [width, height], size);
  const inside = resize(part, 1, [width, height], size);
  const count = inside.length;
  const colors = Float64Array.from({ length: 3 * count }, (_, i) => small[4 * Math.floor(i / 3) + (i % 3)] / 255);
  const outside = inside.map((value) => 1 - value);
  const odds = colorOdds(colors, inside, outside);
  const shareRight = (weight, sign) => {
    let [right, all] = [0, 0];
    for (let i = 0; i < count; i++) {
      all += weight[i];
      if (sign * odds[i] > 0) right += weight[i];
    }
    return right / Math.max(all, 1e-6);
  };
  return Math.min(Math.max(shareRight(inside, 1) + shareRight(outside, -1) - 1, 0), 1);
}

/**
 * How much likelier colours are on one side than on the other, ln.
 *
 * @param {Float64Array} colors three in [0, 1] a pixel
 * @param {ArrayLike<number>} one weight of each there
 * @param {ArrayLike<number>} other
 * @returns {Float64Array}
 */
export function colorOdds(colors, one, other) {
  const count = colors.length / 3;
  const every = Math.max(1, Math.floor(count / SAMPLES));
  const sampled = Array.from({ length: Math.ceil(count / every) }, (_, i) => i * every);
  const [on, off] = [one, other].map((weight) => lnDensity(colors, mixture(colors, weight, sampled)));
  return on.map((value, i) => value - off[i]);
}

/** Share, mean and covariance of each Gaussian of the weighted colours at some indices. */
function mixture(colors, weight, indices) {
  const centres = spreadCentres(colors, weight, indices);
  const nearest = new Uint8Array(indices.length);
  let sums;
  for (let round = 0; round < ROUNDS; round++) {
    sums = centres.map(() => new Float64Array(4));
    indices.forEach((index, i) => {
      const k = nearestOf(colors, index, centres);
      nearest[i] = k;
      sums[k][3] += weight[index];
      for (let c = 0; c < 3; c++) sums[k][c] += weight[index] * colors[3 * index + c];
    });
    sums.forEach((sum, k) => {
      if (sum[3] > 1e-6) centres[k] = [0, 1, 2].map((c) => sum[c] / sum[3]);
    });
  }
  const all = sums.reduce((total, sum) => total + sum[3], 0);
  return sums.flatMap((sum, k) => {
    if (sum[3] <= 1e-3 * all) return [];
    const mean = [0, 1, 2].map((c) => sum[c] / sum[3]);
    const spread = [0, 0, 0, 0, 0, 0];
    indices.forEach((index, i) => {
      if (nearest[i] !== k) return;
      const [x, y, z] = [0, 1, 2].map((c) => colors[3 * index + c] - mean[c]);
      [x * x, x * y, y * y, x * z, y * z, z * z].forEach((product, j) => (spread[j] += weight[index] * product));
    });
    const covariance = spread.map((value, j) => value / sum[3] + ([0, 2, 5].includes(j) ? LEAST_VARIANCE : 0));
    return [{ share: sum[3] / all, mean, covariance }];
  });
}

/** Starting centres, each the colour that counts most by weight and distance from those before. */
function spreadCentres(colors, weight, indices) {
  const first = [0, 0, 0];
  let total = 0;
  for (const index of indices) {
    total += weight[index];
    for (let c = 0; c < 3; c++) first[c] += weight[index] * colors[3 * index + c];
  }
  const centres = [first.map((sum) => sum / Math.max(total, 1e-6))];
  const distances = new Float64Array(indices.length).fill(Infinity);
  while (centres.length < COLORS) {
    let [best, most] = [0, -1];
    indices.forEach((index, i) => {
      distances[i] = Math.min(distances[i], squaredDistance(colors, index, centres.at(-1)));
      if (weight[index] * distances[i] > most) [best, most] = [index, weight[index] * distances[i]];
    });
    centres.push([...colors.subarray(3 * best, 3 * best + 3)]);
  }
  return centres;
}

function squaredDistance(colors, index, [x, y, z]) {
  const at = 3 * index;
  return (colors[at] - x) ** 2 + (colors[at + 1] - y) ** 2 + (colors[at + 2] - z) ** 2;
}

function nearestOf(colors, index, centres) {
  let [nearest, least] = [0, Infinity];
  for (let k = 0; k < centres.length; k++) {
    const distance = squaredDistance(colors, index, centres[k]);
    if (distance < least) [nearest, least] = [k, distance];
  }
  return nearest;
}

/** ln of the mixture's density at every colour, and of a little evenly spread over all of them. */
function lnDensity(colors, parts) {
  const density = new Float64Array(colors.length / 3).fill(EVEN);
  for (const { share, mean, covariance: [a, b, d, c, e, f] } of parts) {
    // the covariance is L L^T with L lower triangular
    const p = Math.sqrt(a);
    const [q, s] = [b / p, c / p];
    const r = Math.sqrt(d - q * q);
    const t = (e - s * q) / r;
    const u = Math.sqrt(f - s * s - t * t);
    const scale = share / (p * r * u) / (2 * Math.PI) ** 1.5;
    for (let i = 0, at = 0; i < density.length; i++, at += 3) {
      const x = (colors[at] - mean[0]) / p;
      const y = (colors[at + 1] - mean[1] - q * x) / r;
      const z = (colors[at + 2] - mean[2] - s * x - t * y) / u;
      density[i] += scale * Math.exp(-0.5 * (x * x + y * y + z * z));
    }
  }
  return density.map(Math.log);
}
