/** Three spheres under a map: matt, silver, mirror. Seen along -Z by an orthographic camera. */

import { displayByte } from "../../src/core/response.js";
import { MAP_HEIGHT } from "../../src/core/latlong.js";
import { halve } from "../../src/light/environment.js";
import { blurCosinePower } from "../../src/light/filtering.js";
import { lookupOf, readMap } from "../../src/light/lookup.js";

export const SPHERE_SIZE = 96;
export const SPHERE_NAMES = ["matte", "silver", "mirror"];

const SILVER_F0 = 0.9;
/** Sharpness of the cosine lobe about the mirror direction that stands for GGX of alpha 0.3. */
const SILVER_SHARPNESS = 5;
const SMALL = MAP_HEIGHT / 2;

/**
 * The spheres' radiance, in the map's units.
 *
 * @param {Float32Array} radiance [64, 128, 3]
 * @returns {Record<string, Float32Array>} of each name [SPHERE_SIZE, SPHERE_SIZE, 3]
 */
export function shadeSpheres(radiance) {
  const small = halve(radiance, MAP_HEIGHT);
  return {
    matte: readMap(blurCosinePower(small, SMALL, 3, 1), lookup(SMALL, false), newSphere()),
    silver: readMap(blurCosinePower(small, SMALL, 3, SILVER_SHARPNESS), lookup(SMALL, true), newSphere()).map((value) => SILVER_F0 * value),
    mirror: readMap(radiance, lookup(MAP_HEIGHT, true), newSphere()),
  };
}

/** Exposure [EV], at most the camera's, at which a white matte sphere is not clipped. */
export const unclippedEv = ({ matte }) => Math.min(0, -Math.log2(matte.reduce((a, b) => Math.max(a, b), 0)));

/** A sphere as the camera would show it at an exposure [EV]: RGBA, transparent around it. */
export function displaySphere(sphere, exposureEv) {
  const gain = 2 ** exposureEv;
  const rgba = new Uint8ClampedArray(4 * COVER.length);
  for (let pixel = 0, at = 0; pixel < COVER.length; pixel++, at += 4) {
    if (COVER[pixel] === 0) continue;
    for (let c = 0; c < 3; c++) rgba[at + c] = displayByte(gain * sphere[3 * pixel + c]);
    rgba[at + 3] = 255 * COVER[pixel];
  }
  return rgba;
}

const newSphere = () => new Float32Array(3 * COVER.length);

/** A pixel's place on the sphere: x to the right, y up; 1 is the outline. */
function placeOf(pixel) {
  const x = (((pixel % SPHERE_SIZE) + 0.5) / SPHERE_SIZE) * 2 - 1;
  const y = 1 - ((Math.floor(pixel / SPHERE_SIZE) + 0.5) / SPHERE_SIZE) * 2;
  return [x, y];
}

/** How far each pixel is covered by the sphere. */
const COVER = Float32Array.from({ length: SPHERE_SIZE * SPHERE_SIZE }, (_, pixel) => {
  const within = 1 - Math.hypot(...placeOf(pixel));
  return Math.min(Math.max((within * SPHERE_SIZE) / 2 + 0.5, 0), 1);
});

const lookups = new Map();

/** Where each pixel reads a map: along its normal or its mirror direction. */
function lookup(height, mirrors) {
  const key = `${height} ${mirrors}`;
  if (!lookups.has(key)) {
    const directions = new Float64Array(3 * COVER.length);
    for (let pixel = 0; pixel < COVER.length; pixel++) {
      const [x, y] = placeOf(pixel);
      const z = Math.sqrt(Math.max(1 - x * x - y * y, 0));
      directions.set(mirrors ? [2 * z * x, 2 * z * y, 2 * z * z - 1] : [x, y, z], 3 * pixel);
    }
    lookups.set(key, lookupOf(height, directions));
  }
  return lookups.get(key);
}
