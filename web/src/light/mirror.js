/** The part of a map that a mirror of known shape shows, as anyprobe.estimate.material_hint.measure. */

import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT, directionToUv, pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { inverseResponse, response } from "../core/response.js";
import { CROP_SIZE, NORMALS_SIZE } from "../photo/crop.js";
import { resize } from "../photo/resize.js";
import { lookupOf } from "./lookup.js";

const MIRROR = CONTRACT.mirror;
const PIXELS = 2 * MAP_HEIGHT * MAP_HEIGHT;

/** A mean of normals shorter than this is of places that are not all known. */
const SHORTEST = 0.9;

/**
 * A prediction with what the object mirrors in the place of its own.
 *
 * @param {{radiance: Float32Array, confidence: Float32Array | null}} prediction [64, 128, 3] and [64, 128], in the crop's frame
 * @param {Float32Array} image [4, 128, 128] of cropObject
 * @param {Float32Array} normals [3, 64, 64] of cropNormals
 * @param {number} tanHalf
 * @param {number[]} f0 reflectance of the mirror, RGB
 */
export function measured(prediction, image, normals, tanHalf, f0) {
  const { directions, light, clipped } = mirroredBy(image, normals, tanHalf, f0);
  const at = pixelDirections(MAP_HEIGHT);
  const radiance = Float64Array.from(prediction.radiance, (value) => Math.min(value, 1));
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
  aboveWhite(prediction.radiance, places, unseen).forEach((value, i) => (radiance[i] += value));
  const confidence = prediction.confidence?.map((value, i) => value + (1 - unseen[i]) * (MIRROR.confidence - value)) ?? null;
  const found = { ...prediction, radiance: Float32Array.from(radiance), confidence };
  if (!prediction.lnRadiance) return found;
  const lnRadiance = found.radiance.map((value) => Math.log(Math.max(value, 1e-6)));
  return { ...found, ldr: found.radiance.map((value) => response(value)), lnRadiance };
}

/** What each pixel of the mirror shows: from where, how bright, three numbers each, and whether it is clipped, thrice. */
function mirroredBy(image, normals, tanHalf, f0) {
  const plane = CROP_SIZE * CROP_SIZE;
  const side = NORMALS_SIZE * NORMALS_SIZE;
  const wide = [0, 1, 2].map((axis) =>
    resize(normals.subarray(axis * side, (axis + 1) * side), 1, [NORMALS_SIZE, NORMALS_SIZE], [CROP_SIZE, CROP_SIZE]),
  );
  const [directions, light, clipped] = [[], [], []];
  for (let i = 0; i < plane; i++) {
    const [nx, ny, nz] = wide.map((values) => values[i]);
    const length = Math.hypot(nx, ny, nz);
    if (!(length > SHORTEST && image[3 * plane + i] > 0.99)) continue;
    const x = -(((i % CROP_SIZE) + 0.5) / CROP_SIZE * 2 - 1) * tanHalf;
    const y = ((Math.floor(i / CROP_SIZE) + 0.5) / CROP_SIZE * 2 - 1) * tanHalf;
    const far = Math.hypot(x, y, 1);
    const cosine = (nx * x + ny * y + nz) / far / length;
    if (!(cosine > MIRROR.steep)) continue;
    directions.push((2 * cosine * nx) / length - x / far, (2 * cosine * ny) / length - y / far, (2 * cosine * nz) / length - 1 / far);
    const display = [0, 1, 2].map((c) => image[c * plane + i]);
    const grazing = Math.min(Math.max(1 - cosine, 0), 1) ** 5; // Schlick's weight
    display.forEach((value, c) => light.push(inverseResponse(Math.min(value, MIRROR.clipped)) / (f0[c] + (1 - f0[c]) * grazing)));
    const isClipped = Math.max(...display) >= MIRROR.clipped ? 1 : 0;
    clipped.push(isClipped, isClipped, isClipped);
  }
  return { directions, light, clipped };
}

/** Values of three numbers splatted onto the four pixels around each direction: sums and counts. */
function gathered(values, directions, height) {
  const width = 2 * height;
  const [sums, counts] = [new Float64Array(3 * width * height), new Float64Array(width * height)];
  for (let at = 0; at < directions.length; at += 3) {
    const [u, v] = directionToUv(directions[at], directions[at + 1], directions[at + 2]);
    const column = (u * width - 0.5 + width) % width;
    const row = Math.min(Math.max(v * height - 0.5, 0), height - 1.001);
    const [left, top] = [Math.floor(column), Math.floor(row)];
    for (let corner = 0; corner < 4; corner++) {
      const [right, down] = [corner & 1, corner >> 1];
      const share = (right ? column - left : 1 - column + left) * (down ? row - top : 1 - row + top);
      const pixel = (top + down) * width + ((left + right) % width);
      counts[pixel] += share;
      for (let c = 0; c < 3; c++) sums[3 * pixel + c] += share * values[at + c];
    }
  }
  return { sums, counts };
}

/** The light above white of a map, over clipped places, half of it evenly, and over what is not seen. */
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
