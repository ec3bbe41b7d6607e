/**
 * The dominant light: the one lobe that a directional light stands for (sun, lamp, window).
 *
 * As anyprobe.light.dominant_light: the connected pixels around the brightest one whose luminance,
 * averaged over a cap 10 degrees across, is at least half the peak; with the pixels that touch
 * them, less their surroundings.
 */

import { CONTRACT } from "../core/contract.js";
import { luminance } from "../core/color.js";
import { pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { blurCap } from "./filtering.js";

const { blur_deg: BLUR_DEG, lobe_level: LOBE_LEVEL, ring_px: RING_PX } = CONTRACT.dominant_light;
const { error: ERROR } = CONTRACT.dominant_light;
const BLUR_RADIUS = (BLUR_DEG * Math.PI) / 180;

/** Grow a mask by one pixel up, down, left and right on the sphere; a touched pole row is taken whole. */
export function dilate(mask, height) {
  const width = 2 * height;
  const grown = mask.slice();
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      if (!mask[row * width + column]) continue;
      grown[row * width + ((column + 1) % width)] = 1;
      grown[row * width + ((column + width - 1) % width)] = 1;
      if (row > 0) grown[(row - 1) * width + column] = 1;
      if (row < height - 1) grown[(row + 1) * width + column] = 1;
    }
  }
  for (const pole of [0, height - 1]) {
    const line = mask.subarray(pole * width, (pole + 1) * width);
    if (line.includes(1)) grown.fill(1, pole * width, (pole + 1) * width);
  }
  return grown;
}

/** The part of a mask that is connected to one of its pixels on the sphere. */
export function connected(mask, height, start) {
  const width = 2 * height;
  const region = new Uint8Array(mask.length);
  const waiting = [start];
  const visit = (pixel) => {
    if (!mask[pixel] || region[pixel]) return;
    region[pixel] = 1;
    waiting.push(pixel);
  };
  region[start] = 1;
  while (waiting.length) {
    const pixel = waiting.pop();
    const column = pixel % width;
    const row = (pixel - column) / width;
    visit(row * width + ((column + 1) % width));
    visit(row * width + ((column + width - 1) % width));
    if (row > 0) visit(pixel - width);
    if (row < height - 1) visit(pixel + width);
    if (row === 0 || row === height - 1) { // all pixels of a pole's row touch each other there
      for (let other = row * width; other < (row + 1) * width; other++) visit(other);
    }
  }
  return region;
}

/**
 * The brightest lobe of a map as a directional light, in the map's frame.
 *
 * @param {Float32Array} radiance H * 2H * 3
 * @param {number} height
 * @returns {{direction: number[], irradiance: number[], color: number[], solidAngle: number, directionality: number,
 *   errorDeg: number, pixels: number[], surrounding: number[]}} direction is a unit vector towards the light; irradiance is
 *   that of a plane facing it; a map without a lobe has irradiance 0 and direction +Y; errorDeg is how far off it is at most
 *   in two of three maps that are estimates; pixels are those it is made of, surrounding the radiance beside them
 */
export function findDominantLight(radiance, height) {
  const width = 2 * height;
  const d = pixelDirections(height);
  const rowAngles = pixelSolidAngles(height);
  const solidAngle = (pixel) => rowAngles[Math.floor(pixel / width)];
  const bright = new Float32Array(height * width);
  const moment = [0, 0, 0];
  let total = 0;
  for (let row = 0, pixel = 0; row < height; row++) {
    let [sum, x, y, z] = [0, 0, 0, 0];
    for (const end = pixel + width; pixel < end; pixel++) {
      const at = 3 * pixel;
      const value = luminance(radiance[at], radiance[at + 1], radiance[at + 2]);
      bright[pixel] = value;
      sum += value;
      x += value * d[at];
      y += value * d[at + 1];
      z += value * d[at + 2];
    }
    total += rowAngles[row] * sum;
    [x, y, z].forEach((value, axis) => (moment[axis] += rowAngles[row] * value));
  }
  const directionality = total > 0 ? Math.hypot(...moment) / total : 0;

  const blurred = blurCap(bright, height, 1, BLUR_RADIUS);
  let peak = 0;
  for (let pixel = 1; pixel < blurred.length; pixel++) if (blurred[pixel] > blurred[peak]) peak = pixel;
  const level = LOBE_LEVEL * blurred[peak];
  const isBright = new Uint8Array(blurred.length);
  for (let pixel = 0; pixel < blurred.length; pixel++) isBright[pixel] = blurred[pixel] >= level ? 1 : 0;
  const lobe = connected(isBright, height, peak);
  const source = dilate(lobe, height);
  const around = ringOf(source, height);

  const surrounding = [0, 0, 0];
  let weight = 0;
  for (let pixel = 0; pixel < around.length; pixel++) {
    if (!around[pixel]) continue;
    weight += solidAngle(pixel);
    for (let c = 0; c < 3; c++) surrounding[c] += solidAngle(pixel) * radiance[3 * pixel + c];
  }
  surrounding.forEach((value, c) => (surrounding[c] = value / weight));
  const excess = (pixel) => [0, 1, 2].map((c) => radiance[3 * pixel + c] - surrounding[c]);

  const pixels = [];
  const mean = [0, 0, 0];
  let lobeAngle = 0;
  for (let pixel = 0; pixel < source.length; pixel++) {
    if (lobe[pixel]) lobeAngle += solidAngle(pixel);
    if (!source[pixel]) continue;
    pixels.push(pixel);
    const energy = Math.max(luminance(...excess(pixel)), 0) * solidAngle(pixel);
    for (let axis = 0; axis < 3; axis++) mean[axis] += energy * d[3 * pixel + axis];
  }
  const length = Math.hypot(...mean);
  if (length <= 1e-6 * total) { // rounding alone, or light from all around: no direction
    const none = { direction: [0, 1, 0], irradiance: [0, 0, 0], color: [1, 1, 1], solidAngle: 0 };
    return { ...none, directionality, errorDeg: ERROR.most_deg, pixels: [], surrounding };
  }
  const direction = mean.map((value) => value / length);
  const irradiance = [0, 0, 0];
  for (const pixel of pixels) {
    const cosine =
      d[3 * pixel] * direction[0] + d[3 * pixel + 1] * direction[1] + d[3 * pixel + 2] * direction[2];
    excess(pixel).forEach((value, c) => {
      irradiance[c] += Math.max(cosine, 0) * solidAngle(pixel) * value;
    });
  }
  irradiance.forEach((value, c) => (irradiance[c] = Math.max(value, 0)));
  const most = Math.max(...irradiance);
  const color = most > 0 ? irradiance.map((value) => value / most) : [1, 1, 1];
  const errorDeg = directionError(spreadAbout(bright, height, direction, ERROR), ERROR);
  return { direction, irradiance, color, solidAngle: lobeAngle, directionality, errorDeg, pixels, surrounding };
}

/**
 * Mean angle in degrees between a unit direction and where a map's light comes from: bright places elsewhere make a
 * direction doubtful, the dim rest of the map hardly. A black map gives 90.
 *
 * @param {Float32Array} bright luminance of each pixel
 * @param {number} height
 * @param {number[]} direction
 * @param {typeof ERROR} error
 */
function spreadAbout(bright, height, direction, error) {
  const d = pixelDirections(height);
  const rowAngles = pixelSolidAngles(height);
  let [total, sum] = [0, 0];
  for (let pixel = 0; pixel < bright.length; pixel++) {
    const root = Math.sqrt(bright[pixel]); // powers are halves of whole numbers; ** takes ten times as long
    let weight = rowAngles[Math.floor(pixel / (2 * height))];
    for (let half = 0; half < 2 * error.power; half++) weight *= root;
    const cosine = d[3 * pixel] * direction[0] + d[3 * pixel + 1] * direction[1] + d[3 * pixel + 2] * direction[2];
    total += weight;
    sum += weight * Math.acos(Math.min(Math.max(cosine, -1), 1));
  }
  return total > 0 ? (180 / Math.PI) * (sum / total) : 90;
}

/** Error [degrees] of a dominant light with such a spread, not exceeded in two of three estimates. */
function directionError(spreadDeg, error) {
  return Math.min(error.factor * (spreadDeg + error.offset_deg) ** error.exponent, error.most_deg);
}

/**
 * A map without its dominant light, for renderers that take both: on a plane that faces the light, the
 * irradiance of both together is the map's.
 *
 * @param {Float32Array} radiance
 * @param {ReturnType<typeof findDominantLight>} dominant of this map
 * @returns {Float32Array}
 */
export function withoutDominantLight(radiance, { irradiance, pixels, surrounding }) {
  const rest = radiance.slice();
  for (const pixel of pixels) {
    irradiance.forEach((value, c) => {
      if (value > 0) rest[3 * pixel + c] = Math.max(surrounding[c], 0); // a channel without light stays whole
    });
  }
  return rest;
}

/** The pixels just outside a lobe; the lobe itself where it covers the whole sphere. */
function ringOf(source, height) {
  let grown = source;
  for (let step = 0; step < RING_PX; step++) grown = dilate(grown, height);
  const ring = grown.map((value, i) => (source[i] ? 0 : value));
  return ring.includes(1) ? ring : source;
}
