/** The part of a map that a mirror of known shape shows, as anyprobe.estimate.material_hint.measure. */

import { CONTRACT } from "../core/contract.js";
import { turned } from "../core/frames.js";
import { MAP_HEIGHT, pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { inverseResponse } from "../core/response.js";
import { resize } from "../photo/resize.js";
import { lookupOf } from "./lookup.js";

/** Sides of the squares in which the object and its normals are. */
const { crop: CROP_SIZE, normals: NORMALS_SIZE } = CONTRACT.sizes;

const MIRROR = CONTRACT.mirror;
/** Display value from which on a pixel is only a lower bound of its light. */
const CLIPPED = CONTRACT.curve.clipped;
const PIXELS = 2 * MAP_HEIGHT * MAP_HEIGHT;

/** A mean of normals shorter than this includes unknown ones. */
const SHORTEST = 0.9;

/**
 * The map and its confidence, replaced where the object mirrors it.
 *
 * @param {Record<string, Float32Array>} said of Models.light, in the camera's frame
 * @param {number[]} f0 reflectance of the mirror, RGB
 * @param {number} worth factor of the confidence, by how well the object is exposed
 */
export function measured(said, f0, worth) {
  const { directions, light, clipped } = mirroredBy(said, f0);
  const at = pixelDirections(MAP_HEIGHT);
  const radiance = Float64Array.from(said.radiance, (value) => Math.min(value, 1));
  const unseen = new Float64Array(PIXELS).fill(1);
  for (let level = MIRROR.levels - 1; level >= 0; level--) {
    const height = MAP_HEIGHT >> level;
    const { sums, counts } = gathered(light, directions, height);
    const { pixels, shares } = lookupOf(height, at);
    for (let i = 0; i < PIXELS; i++) {
      const given = [0, 0, 0, 0];
      for (let corner = 4 * i; corner < 4 * i + 4; corner++) {
        const from = pixels[corner] / 3;
        const share = (shares[corner] * counts[from]) / (counts[from] + MIRROR.enough);
        for (let c = 0; c < 3; c++) given[c] += (share * sums[3 * from + c]) / Math.max(counts[from], 1e-6);
        given[3] += share;
      }
      for (let c = 0; c < 3; c++) radiance[3 * i + c] = radiance[3 * i + c] * (1 - given[3]) + given[c];
      unseen[i] *= 1 - given[3];
    }
  }
  const clippedHere = gathered(clipped, directions, MAP_HEIGHT);
  const places = clippedHere.counts.map((count, i) => clippedHere.sums[3 * i] / (count + MIRROR.enough));
  aboveWhite(said.radiance, places, unseen).forEach((value, i) => (radiance[i] += value));
  const confidence = said.confidence.map((value, i) => value + (1 - unseen[i]) * (worth * MIRROR.confidence - value));
  return { radiance: Float32Array.from(radiance), confidence };
}

/** Per pixel of the mirror and channel: the direction it mirrors, its radiance, and whether it is clipped. */
function mirroredBy({ crop, crop_frame: frame, object_normals: normals }, f0) {
  const wide = resize(normals, 3, [NORMALS_SIZE, NORMALS_SIZE], [CROP_SIZE, CROP_SIZE]);
  const tanHalf = frame[9];
  const [directions, light, clipped] = [[], [], []];
  for (let i = 0; i < CROP_SIZE * CROP_SIZE; i++) {
    const [nx, ny, nz] = wide.subarray(3 * i, 3 * i + 3);
    const length = Math.hypot(nx, ny, nz);
    if (!(length > SHORTEST && crop[4 * i + 3] > 0.99)) continue;
    const x = -(((i % CROP_SIZE) + 0.5) / CROP_SIZE * 2 - 1) * tanHalf;
    const y = ((Math.floor(i / CROP_SIZE) + 0.5) / CROP_SIZE * 2 - 1) * tanHalf;
    const far = Math.hypot(x, y, 1);
    const cosine = (nx * x + ny * y + nz) / far / length;
    if (!(cosine > MIRROR.steep)) continue;
    const inCrop = [(2 * cosine * nx) / length - x / far, (2 * cosine * ny) / length - y / far, (2 * cosine * nz) / length - 1 / far];
    directions.push(...turned(frame.subarray(0, 9), inCrop));
    const display = [...crop.subarray(4 * i, 4 * i + 3)];
    const grazing = Math.min(Math.max(1 - cosine, 0), 1) ** 5; // Schlick's weight
    display.forEach((value, c) => light.push(inverseResponse(Math.min(value, CLIPPED)) / (f0[c] + (1 - f0[c]) * grazing)));
    const isClipped = Math.max(...display) >= CLIPPED ? 1 : 0;
    clipped.push(isClipped, isClipped, isClipped);
  }
  return { directions, light, clipped };
}

/** Values of three numbers splatted onto the four pixels around each direction: sums and counts. */
function gathered(values, directions, height) {
  const [sums, counts] = [new Float64Array(6 * height * height), new Float64Array(2 * height * height)];
  const { pixels, shares } = lookupOf(height, directions);
  pixels.forEach((pixel, i) => {
    counts[pixel / 3] += shares[i];
    for (let c = 0; c < 3; c++) sums[pixel + c] += shares[i] * values[3 * (i >> 2) + c];
  });
  return { sums, counts };
}

/** Spread a map's light above white over clipped places, half of it evenly, and over what is not seen. */
function aboveWhite(radiance, clipped, unseen) {
  const above = Float64Array.from(radiance, (value) => Math.max(value - 1, 0));
  if (!clipped.some((share) => share > 0)) return above.map((value, i) => value * unseen[Math.floor(i / 3)]);
  const angles = pixelSolidAngles(MAP_HEIGHT);
  const angleOf = (pixel) => angles[Math.floor(pixel / (2 * MAP_HEIGHT))];
  const power = [0, 0, 0];
  let area = 0;
  for (let pixel = 0; pixel < PIXELS; pixel++) {
    for (let c = 0; c < 3; c++) power[c] += above[3 * pixel + c] * angleOf(pixel);
    area += clipped[pixel] * angleOf(pixel);
  }
  const alike = (power[0] + power[1] + power[2]) / 3 / area;
  const shares = clipped.map((share, pixel) => {
    const one = (above[3 * pixel] + above[3 * pixel + 1] + above[3 * pixel + 2]) / 3;
    return MIRROR.odds * share * (one + alike) + unseen[pixel] * one;
  });
  const total = Math.max(shares.reduce((sum, share, pixel) => sum + share * angleOf(pixel), 0), 1e-12);
  return above.map((_, i) => (shares[Math.floor(i / 3)] * power[i % 3]) / total);
}
