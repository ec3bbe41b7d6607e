/** Three spheres under a map: matt, silver, mirror. Seen along -Z by an orthographic camera. */

import { displayByte } from "../core/response.js";
import { MAP_HEIGHT } from "../core/latlong.js";
import { halve } from "./environment.js";
import { blurCosinePower } from "./filtering.js";
import { lookupOf, readMap } from "./lookup.js";

export const SPHERE_SIZE = 96;
export const SPHERE_NAMES = ["matte", "silver", "mirror"];

const SILVER_F0 = 0.9;
/** Sharpness of the cosine lobe about the mirror direction that stands for GGX of alpha 0.3. */
const SILVER_SHARPNESS = 5;
const SMALL = MAP_HEIGHT / 2;

/**
 * The spheres as display pictures.
 *
 * @param {Float32Array} radiance [64, 128, 3]
 * @returns {Record<string, Uint8ClampedArray>} RGBA of SPHERE_SIZE x SPHERE_SIZE, clear around the sphere
 */
export function drawSpheres(radiance) {
  const small = halve(radiance, MAP_HEIGHT);
  return {
    matte: drawSphere(blurCosinePower(small, SMALL, 3, 1), SMALL, 1, false),
    silver: drawSphere(blurCosinePower(small, SMALL, 3, SILVER_SHARPNESS), SMALL, SILVER_F0, true),
    mirror: drawMirror(radiance, MAP_HEIGHT),
  };
}

/** The mirror sphere alone, under a map [height, 2 height, 3]. */
export function drawMirror(radiance, height) {
  return drawSphere(radiance, height, 1, true);
}

function drawSphere(map, height, gain, mirrors) {
  const { cover, lookup } = surface(height, mirrors);
  const colors = readMap(map, lookup, new Float32Array(3 * cover.length));
  const picture = new Uint8ClampedArray(4 * cover.length);
  for (let pixel = 0, at = 0; pixel < cover.length; pixel++, at += 4) {
    if (cover[pixel] === 0) continue;
    for (let c = 0; c < 3; c++) picture[at + c] = displayByte(gain * colors[3 * pixel + c]);
    picture[at + 3] = 255 * cover[pixel];
  }
  return picture;
}

const surfaces = new Map();

/** How far each pixel is covered by the sphere, and where it reads the map: along its normal or its mirror direction. */
function surface(height, mirrors) {
  const key = `${height} ${mirrors}`;
  if (!surfaces.has(key)) {
    const cover = new Float32Array(SPHERE_SIZE * SPHERE_SIZE);
    const directions = new Float64Array(3 * cover.length);
    for (let pixel = 0; pixel < cover.length; pixel++) {
      const x = (((pixel % SPHERE_SIZE) + 0.5) / SPHERE_SIZE) * 2 - 1;
      const y = 1 - ((Math.floor(pixel / SPHERE_SIZE) + 0.5) / SPHERE_SIZE) * 2;
      const squared = x * x + y * y;
      const z = Math.sqrt(Math.max(1 - squared, 0));
      cover[pixel] = Math.min(Math.max(((1 - Math.sqrt(squared)) * SPHERE_SIZE) / 2 + 0.5, 0), 1);
      directions.set(mirrors ? [2 * z * x, 2 * z * y, 2 * z * z - 1] : [x, y, z], 3 * pixel);
    }
    surfaces.set(key, { cover, lookup: lookupOf(height, directions) });
  }
  return surfaces.get(key);
}
