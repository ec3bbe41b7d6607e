/** What the colours in a found mask say against it, as anyprobe.masks.words. */

import { CONTRACT } from "../core/contract.js";

const { apart: APART, tight: TIGHT, share: SHARE, aside: ASIDE, local: LOCAL, near: NEAR, pixels: PIXELS, rounds: ROUNDS } = CONTRACT.mask.colors;
/** Of fewer pixels nothing is said, and of fewer at a click. */
const [LEAST_PX, LEAST_NEAR_PX] = [50, 3];

/**
 * A few words for each doubt.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 * @param {number[][]} clicks on the object, in pixels
 * @returns {string[]}
 */
export function colorDoubts({ width, height, rgba }, mask, clicks) {
  let [inside, sum] = [0, 0];
  for (const value of mask) [inside, sum] = [inside + (value > 0.5), sum + value];
  const step = Math.max(1, Math.floor(Math.sqrt(inside / PIXELS)));
  const [shares, places] = [[], []];
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) {
      const at = y * width + x;
      if (!(mask[at] > 0.9)) continue;
      const color = [0, 1, 2].map((c) => rgba[4 * at + c] / 255 + 0.03);
      const total = color[0] + color[1] + color[2];
      shares.push(color.map((value) => value / total));
      places.push([x, y]);
    }
  }
  if (shares.length < LEAST_PX) return [];
  const found = areTwo(shares, places) ? ["it may contain two objects of different colours"] : [];
  const reach = Math.max(2 * step, NEAR * Math.sqrt(sum));
  const isLocal = clicks.some(([x, y]) => {
    const near = shares.filter((_, i) => Math.hypot(places[i][0] - x, places[i][1] - y) <= reach);
    if (near.length < LEAST_NEAR_PX) return false;
    const here = [0, 1, 2].map((c) => median(near.map((color) => color[c])));
    return mean(shares.map((color) => Number(distance(color, here) < 0.5 * APART))) < LOCAL;
  });
  if (isLocal) found.push("the click is on a small part of what was found; a box around the object helps");
  return found;
}

/** Whether colours fall into two kinds that lie apart in the picture. */
function areTwo(shares, places) {
  const axis = mainAxis(shares);
  const along = shares.map((color) => color.reduce((sum, value, c) => sum + value * axis[c], 0));
  const ofEnd = (better) => shares[along.reduce((best, value, i) => (better(value, along[best]) ? i : best), 0)];
  let middles = [ofEnd((a, b) => a < b), ofEnd((a, b) => a > b)];
  let kinds;
  for (let round = 0; round < ROUNDS; round++) {
    kinds = shares.map((color) => (distance(color, middles[0]) < distance(color, middles[1]) ? 0 : 1));
    const first = 1 - mean(kinds);
    if (!(first >= SHARE && first <= 1 - SHARE)) return false;
    middles = [0, 1].map((kind) => means(shares.filter((_, i) => kinds[i] === kind)));
  }
  const apart = distance(...middles);
  const within = Math.sqrt(mean([0, 1].map((kind) => spread(shares.filter((_, i) => kinds[i] === kind)))));
  if (apart < APART || within > TIGHT * apart) return false;
  const of = [0, 1].map((kind) => places.filter((_, i) => kinds[i] === kind));
  return distance(means(of[0]), means(of[1])) > ASIDE * Math.sqrt(mean(of.map((some) => spread(some) / 2)));
}

/** Direction in which colours differ most, by powers of their covariance. */
function mainAxis(colors) {
  const middle = means(colors);
  const covariance = Array.from({ length: 9 }, () => 0);
  for (const color of colors) {
    for (let i = 0; i < 9; i++) covariance[i] += (color[Math.floor(i / 3)] - middle[Math.floor(i / 3)]) * (color[i % 3] - middle[i % 3]);
  }
  let axis = [1, -0.5, -0.25]; // shares sum to one: no direction of theirs is along (1, 1, 1)
  for (let i = 0; i < 100; i++) {
    const next = [0, 1, 2].map((row) => axis.reduce((sum, value, c) => sum + covariance[3 * row + c] * value, 0));
    const length = Math.hypot(...next);
    if (!(length > 0)) return axis;
    axis = next.map((value) => value / length);
  }
  return axis;
}

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const means = (points) => points[0].map((_, c) => mean(points.map((point) => point[c])));
const distance = (a, b) => Math.hypot(...a.map((value, c) => value - b[c]));

/** Sum of the variances of points' coordinates. */
function spread(points) {
  const middle = means(points);
  return mean(points.map((point) => distance(point, middle) ** 2));
}

function median(values) {
  const sorted = values.toSorted((a, b) => a - b);
  return (sorted[Math.floor((sorted.length - 1) / 2)] + sorted[Math.ceil((sorted.length - 1) / 2)]) / 2;
}
