/** The ground under the object, and how its colour goes on below the horizon: as anyprobe.estimate.ground and below_horizon. */

import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT, pixelDirections } from "../core/latlong.js";
import { focalPx, pixelDirection } from "./crop.js";

const GROUND = CONTRACT.ground;
const PIXELS = 2 * MAP_HEIGHT * MAP_HEIGHT;
const RADIANS = Math.PI / 180;

/** Cover below which there is none. */
const LEAST_COVER = 1e-3;

/**
 * Where an object touches the ground: the middle of its mask's lower border.
 *
 * @param {Float32Array} mask
 * @param {number} width of the picture
 * @param {number[]} box x0, y0, x1, y1 of mask > 0.5
 * @returns {number[]} x, y in pixels
 */
export function contactOf(mask, width, [x0, y0, x1, y1]) {
  const least = GROUND.least_contact * (x1 - x0);
  let row = y1;
  const countIn = (y) => {
    let count = 0;
    for (let x = x0; x < x1; x++) if (mask[y * width + x] > 0.5) count++;
    return count;
  };
  while (row > y0 + 1 && countIn(row - 1) < least) row--;
  let [sum, count] = [0, 0];
  for (let y = Math.max(Math.floor(row - GROUND.contact_band * (y1 - y0)), y0); y < row; y++) {
    for (let x = x0; x < x1; x++) {
      if (mask[y * width + x] <= 0.5) continue;
      sum += x + 0.5;
      count++;
    }
  }
  return [count ? sum / count : (x0 + x1) / 2, row];
}

/**
 * How far a camera of unknown pitch is taken to look down [degrees]: as usual, or far enough to see the ground at a row
 * `least_slope_deg` below the horizon.
 *
 * @param {number} row of the real object's base
 * @param {number} height of the picture
 * @param {number} focal pixels
 */
export function likelyPitchDeg(row, height, focal) {
  return Math.max(GROUND.usual_pitch_deg, GROUND.least_slope_deg - Math.atan2(row - height / 2, focal) / RADIANS);
}

/** Up [3] in the frame of a camera that looks down so far. */
export function upOf(pitchDeg) {
  return [0, Math.cos(pitchDeg * RADIANS), Math.sin(pitchDeg * RADIANS)];
}

/**
 * The map below the horizon where what is seen leaves it open, in the colour of the ground that is seen around the object.
 *
 * @param {Float32Array} seen [4, 64, 128] of seeSurroundings
 * @param {import("./picture.js").Picture} picture
 * @param {number} longFovDeg
 * @param {ReturnType<typeof import("./crop.js").cropObject>} crop
 * @param {number} [pitchDeg] how far the camera looks down, where it is known
 * @returns {Float32Array | null} likewise; null where too little of the ground is seen, or the object would float
 */
export function groundBelow(seen, { width, height }, longFovDeg, { cameraFromCrop, tanHalf, mask, box }, pitchDeg) {
  const contactPx = contactOf(mask, width, box);
  const focal = focalPx(width, height, longFovDeg);
  const [, upY, upZ] = upOf(pitchDeg ?? likelyPitchDeg(contactPx[1], height, focal));
  const ray = pixelDirection(contactPx, width, height, longFovDeg);
  const length = Math.hypot(...ray);
  const foot = ray.map((value) => value / length);
  const begins = Math.sin(GROUND.begins_deg * RADIANS);
  const slope = -(foot[1] * upY + foot[2] * upZ);
  if (slope < begins) return null;
  const reach = (GROUND.near * tanHalf) / slope;
  const [a, b, c, d, e, f, g, h, i] = cameraFromCrop;
  const directions = pixelDirections(MAP_HEIGHT);
  const downs = new Float32Array(PIXELS);
  const near = [[], [], []];
  for (let pixel = 0, at = 0; pixel < PIXELS; pixel++, at += 3) {
    const [x, y, z] = [directions[at], directions[at + 1], directions[at + 2]];
    const ray = [a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z];
    const down = -(ray[1] * upY + ray[2] * upZ);
    downs[pixel] = down;
    const cover = seen[3 * PIXELS + pixel];
    if (down <= begins || cover <= 0.9) continue;
    if (Math.hypot(...ray.map((value, axis) => value / down - foot[axis] / slope)) >= reach) continue;
    for (let channel = 0; channel < 3; channel++) near[channel].push(Math.min(seen[channel * PIXELS + pixel] / cover, 1));
  }
  if (near[0].length < GROUND.least_pixels) return null;
  const color = near.map(median);
  const below = new Float32Array(4 * PIXELS);
  for (let pixel = 0; pixel < PIXELS; pixel++) {
    const depthDeg = Math.asin(Math.min(Math.max(downs[pixel], -1), 1)) / RADIANS;
    const share = (depthDeg - GROUND.begins_deg) / (GROUND.full_deg - GROUND.begins_deg);
    const cover = GROUND.weight * Math.min(Math.max(share, 0), 1) * (1 - seen[3 * PIXELS + pixel]);
    if (cover < LEAST_COVER) continue;
    for (let channel = 0; channel < 3; channel++) below[channel * PIXELS + pixel] = color[channel] * cover;
    below[3 * PIXELS + pixel] = cover;
  }
  return below;
}

/** @param {number[]} values */
export function median(values) {
  const sorted = Float64Array.from(values).sort();
  const middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}
