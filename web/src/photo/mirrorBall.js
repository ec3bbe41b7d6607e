/**
 * Whether an object looks like a mirror ball, as anyprobe.estimate.extract, where the rules stand: a round outline, and
 * fine structure that no smooth shading explains. It is one if the network takes it for metal, too.
 */

import { CONTRACT } from "../core/contract.js";
import { besideFit } from "../core/linear.js";
import { inverseResponse } from "../core/response.js";
import { shBasis } from "../light/harmonics.js";
import { give, notice } from "../notices.js";
import { objectBox } from "./picture.js";
import { raysOf, sphereOfOutline } from "./sphere.js";

const BALL = CONTRACT.mirror_ball;

/** Fewest pixels for a fit of shading. */
const LEAST_PIXELS = 100;

/** The warning that the object was taken for a mirror ball. */
export const saidOfBall = () =>
  notice("mirror-ball", "the object is round and shows its surroundings, so it was unwrapped as a mirror ball of chrome, which it may not be", give("material"));

export function looksLikeBall(picture, mask, longFovDeg) {
  const box = objectBox(mask, picture.width);
  if (!box) return false;
  const [side, other] = [Math.max(box[2] - box[0], box[3] - box[1]), Math.min(box[2] - box[0], box[3] - box[1])];
  if (other < Math.max(BALL.least_side_px, 0.8 * side)) return false;
  const photo = everyNth(picture, mask, Math.max(1, Math.floor(side / BALL.most_side)));
  const { normals, overlap } = sphereOfOutline(photo.mask, photo.width, longFovDeg);
  return overlap >= BALL.round && fineness(photo, normals, longFovDeg) >= BALL.fine;
}

/** Every nth pixel both ways: mask, and radiance, three numbers a pixel. */
function everyNth({ width, height, rgba }, mask, step) {
  const [across, down] = [Math.ceil(width / step), Math.ceil(height / step)];
  const small = { width: across, mask: new Float32Array(across * down), radiance: new Float32Array(3 * across * down) };
  for (let i = 0; i < across * down; i++) {
    const from = step * (Math.floor(i / across) * width + (i % across));
    small.mask[i] = mask[from];
    for (let c = 0; c < 3; c++) small.radiance[3 * i + c] = inverseResponse(rgba[4 * from + c] / 255);
  }
  return small;
}

/** The standard deviation of ln radiance around the best sum of harmonics of the normal, where the ball faces the camera. */
function fineness({ width, mask, radiance }, normals, longFovDeg) {
  const rays = raysOf(width, mask.length / width, longFovDeg);
  const facing = (at) => -(normals[at] * rays[at] + normals[at + 1] * rays[at + 1] + normals[at + 2] * rays[at + 2]);
  const pixels = Array.from(mask.keys()).filter((i) => mask[i] > 0.99 && facing(3 * i) > BALL.inner);
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
