/**
 * Whether an object looks like a mirror ball, as anyprobe.estimate.mirror_ball, where the rules stand: a round outline, fine
 * structure that no smooth shading explains, and a network that takes it for metal, a rim that shows the photo's own
 * background, or a ball that is black but for bright spots.
 */

import { CONTRACT } from "../core/contract.js";
import { directionToUv, pixelDirections } from "../core/latlong.js";
import { besideFit } from "../core/linear.js";
import { inverseResponse } from "../core/response.js";
import { shBasis } from "../light/harmonics.js";
import { give, notice } from "../notices.js";
import { median } from "./ground.js";
import { grow } from "./parts.js";
import { objectBox } from "./picture.js";
import { raysOf, sphereOfOutline } from "./sphere.js";

const BALL = CONTRACT.mirror_ball;

/** Fewest pixels for a fit of shading. */
const LEAST_PIXELS = 100;

/** The warning that the object was taken for a mirror ball. */
export const saidOfBall = () =>
  notice("mirror-ball", "the object is round and shows its surroundings, so it was unwrapped as a mirror ball of chrome, which it may not be", give("material"));

/**
 * The probability of a metal, of the network's, from which on an object is a mirror ball; infinity: it never is.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 * @param {number} longFovDeg
 * @param {boolean} isLensKnown whether that is the picture's own field of view
 */
export function leastMetal(picture, mask, longFovDeg, isLensKnown) {
  const box = objectBox(mask, picture.width);
  if (!box) return Infinity;
  const [side, other] = [Math.max(box[2] - box[0], box[3] - box[1]), Math.min(box[2] - box[0], box[3] - box[1])];
  if (other < Math.max(BALL.least_side_px, 0.8 * side)) return Infinity;
  const ofPhoto = Math.min(Math.floor(Math.max(picture.width, picture.height) / BALL.long_px), Math.floor(side / BALL.least_side));
  const photo = everyNth(picture, mask, Math.max(1, Math.floor(side / BALL.most_side), ofPhoto));
  const sphere = sphereOfOutline(photo.mask, photo.width, longFovDeg);
  if (sphere.overlap < BALL.round) return Infinity;
  const ball = seenOf(photo, sphere.normals, longFovDeg);
  const inner = ball.on.filter((_, k) => ball.facing[k] > BALL.inner);
  const fine = fineness(photo, sphere.normals, inner);
  if (fine < BALL.fine) return Infinity;
  if (isBlackWithSpots(photo, inner)) return 0;
  const unlessAgreed = fine >= BALL.fine_metal ? BALL.metal : Infinity;
  const beside = besideOf(photo);
  if (!beside.length) return unlessAgreed;
  for (const factor of isLensKnown ? [1] : BALL.lenses) {
    const fovDeg = factor * longFovDeg;
    const { normals } = factor === 1 ? sphere : sphereOfOutline(photo.mask, photo.width, fovDeg);
    const { rays, on, facing } = seenOf(photo, normals, fovDeg);
    const mirrored = on.map((i, k) => [0, 1, 2].map((axis) => 2 * facing[k] * normals[3 * i + axis] + rays[3 * i + axis]));
    const background = beside.map((i) => [0, 1, 2].map((axis) => rays[3 * i + axis]));
    const [whole, finely] = agreement(cellsOf(mirrored, on, photo), cellsOf(background, beside, photo));
    if (whole >= BALL.agree && finely >= BALL.agree_finely) return 0;
  }
  return unlessAgreed;
}

/** Every nth pixel both ways: mask, radiance, three numbers a pixel, and which are transparent where some are. */
function everyNth({ width, height, rgba }, mask, step) {
  const [across, down] = [Math.ceil(width / step), Math.ceil(height / step)];
  const small = { width: across, mask: new Float32Array(across * down), radiance: new Float32Array(3 * across * down) };
  const clear = new Uint8Array(across * down);
  for (let i = 0; i < clear.length; i++) {
    const from = step * (Math.floor(i / across) * width + (i % across));
    small.mask[i] = mask[from];
    clear[i] = rgba[4 * from + 3] < 128 ? 1 : 0;
    for (let c = 0; c < 3; c++) small.radiance[3 * i + c] = inverseResponse(rgba[4 * from + c] / 255);
  }
  return { ...small, clear: clear.includes(0) ? clear : clear.fill(0) };
}

/** The pixels that show the ball, n.wo of each, and the rays of all. */
function seenOf({ width, mask }, normals, longFovDeg) {
  const rays = raysOf(width, mask.length / width, longFovDeg);
  const [on, facing] = [[], []];
  for (let i = 0, at = 0; i < mask.length; i++, at += 3) {
    const cosine = -(normals[at] * rays[at] + normals[at + 1] * rays[at + 1] + normals[at + 2] * rays[at + 2]);
    if (!(mask[i] > 0.99 && cosine > BALL.facing)) continue;
    on.push(i);
    facing.push(cosine);
  }
  return { rays, on, facing };
}

/** The standard deviation of ln radiance around the best sum of harmonics of the normal. */
function fineness({ radiance }, normals, pixels) {
  if (pixels.length < LEAST_PIXELS) return 0;
  const terms = pixels.map((i) => {
    const [x, y, z] = normals.subarray(3 * i, 3 * i + 3);
    return [...shBasis(x, y, z), x ** 3, y ** 3, x * y * z];
  });
  const levels = pixels.map((i) => [0, 1, 2].reduce((sum, c) => sum + Math.log(radiance[3 * i + c] + BALL.floor) / 3, 0));
  const left = besideFit(terms, levels);
  const mean = left.reduce((sum, value) => sum + value, 0) / left.length;
  return Math.sqrt(left.reduce((sum, value) => sum + (value - mean) ** 2, 0) / left.length);
}

function isBlackWithSpots({ radiance }, pixels) {
  const brightest = Float64Array.from(pixels, (i) => Math.max(radiance[3 * i], radiance[3 * i + 1], radiance[3 * i + 2])).sort();
  const place = BALL.black_share * (brightest.length - 1);
  const low = Math.floor(place);
  const level = brightest[low] + (place - low) * (brightest[Math.min(low + 1, brightest.length - 1)] - brightest[low]);
  return level <= BALL.black && brightest.filter((value) => value >= BALL.bright).length / brightest.length >= BALL.bright_share;
}

/** The pixels of the background, some away from the object. */
function besideOf({ width, mask, clear }) {
  const near = grow(Uint8Array.from(mask, (value) => (value >= 0.01 ? 1 : 0)), width, BALL.margin_px);
  return Array.from(near.keys()).filter((i) => !near[i] && !clear[i]);
}

/** The count [N] and the mean radiance [3 N] of pixels in each cell of the sphere, by their directions. */
function cellsOf(directions, pixels, { radiance }) {
  const [rows, columns] = [BALL.cell_rows, 2 * BALL.cell_rows];
  const [counts, means] = [new Float64Array(rows * columns), new Float64Array(3 * rows * columns)];
  directions.forEach((direction, k) => {
    const [u, v] = directionToUv(...direction);
    const cell = Math.min(Math.floor(v * rows), rows - 1) * columns + Math.min(Math.floor(u * columns), columns - 1);
    counts[cell]++;
    for (let c = 0; c < 3; c++) means[3 * cell + c] += radiance[3 * pixels[k] + c];
  });
  means.forEach((sum, i) => (means[i] = sum / Math.max(counts[Math.floor(i / 3)], 1)));
  return { counts, means };
}

/**
 * Correlations of what a ball mirrors and what is seen, ln radiance in the cells that have both: directly, and without what
 * changes smoothly with the direction; 0 if there are too few.
 */
function agreement(own, seen) {
  const least = 0.5 * median(seen.counts.filter((count) => count > 0));
  const both = Array.from(own.counts.keys()).filter((i) => own.counts[i] > 0 && seen.counts[i] >= least);
  if (both.length < BALL.least_cells) return [0, 0];
  const values = (means, c) => both.map((i) => means[3 * i + c]);
  const floor = Math.max(BALL.rim_floor, BALL.rim_floor_share * median([0, 1, 2].flatMap((c) => values(seen.means, c))));
  const d = pixelDirections(BALL.cell_rows);
  const level = both.map(() => [1]);
  const smooth = both.map((i) => [1, d[3 * i], d[3 * i + 1], d[3 * i] ** 2, d[3 * i + 1] ** 2, d[3 * i] * d[3 * i + 1]]);
  return [level, smooth].map((terms) => {
    let [ab, aa, bb] = [0, 0, 0];
    for (let c = 0; c < 3; c++) {
      const [a, b] = [own, seen].map(({ means }) => besideFit(terms, values(means, c).map((value) => Math.log(value + floor))));
      a.forEach((value, i) => {
        ab += value * b[i];
        aa += value * value;
        bb += b[i] * b[i];
      });
    }
    return ab / Math.sqrt(aa * bb + 1e-12);
  });
}
