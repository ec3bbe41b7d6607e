/**
 * A map blurred for each roughness, as the cube that three.js reads its reflections from.
 *
 * three.js's own generator integrates a quarter of a million directions by hundreds of samples on the
 * GPU, for maps of any size. Ours has 8,192 pixels: here it takes milliseconds, in the networks' thread.
 */

import { MAP_HEIGHT } from "../core/latlong.js";
import { blurGgx } from "./filtering.js";
import { halve } from "./environment.js";
import { lookupOf, readMap } from "./lookup.js";

/** Sides of the faces, sharpest first; three.js reads roughness 1 - sqrt(1 - level / 3) from each. */
export const FACE_SIZES = [64, 32, 16, 8];

/** Largest half float. */
const HALF_MAX = 65504;

const roughnessOf = (level, sizes) => 1 - Math.sqrt(1 - level / (sizes.length - 1));

/** Direction through s, t in [-1, 1] of OpenGL's faces +X, -X, +Y, -Y, +Z, -Z; not of unit length. */
const FACES = [
  (s, t) => [1, -t, -s],
  (s, t) => [-1, -t, s],
  (s, t) => [s, 1, t],
  (s, t) => [s, -1, -t],
  (s, t) => [s, -t, 1],
  (s, t) => [-s, -t, -1],
];

/**
 * The levels of the cube, each [6, size, size, 4]; the last holds irradiance / pi.
 *
 * Directions are mirrored in X, as three.js expects of cubes that it did not draw itself. Level 1
 * (roughness 0.18) is a mean of four texels: its lobe is about as wide as a pixel of the map.
 *
 * @param {Float32Array} radiance [64, 128, 3]
 * @returns {Float32Array[]}
 */
export function prefilter(radiance) {
  const small = halve(radiance, MAP_HEIGHT);
  const mirror = sample(radiance, MAP_HEIGHT, FACE_SIZES[0]);
  const blurred = (level) => blurGgx(small, MAP_HEIGHT / 2, 3, roughnessOf(level, FACE_SIZES) ** 2);
  const rough = [2, 3].map((level) => sample(blurred(level), MAP_HEIGHT / 2, FACE_SIZES[level]));
  return [mirror, meanOfFours(mirror, FACE_SIZES[0]), ...rough];
}

const lookups = new Map();

/** Direction of each texel, as a place in a map. */
function texels(height, size) {
  const key = `${height} ${size}`;
  if (!lookups.has(key)) {
    const directions = new Float64Array(18 * size * size);
    let at = 0;
    for (const direction of FACES) {
      for (let row = 0; row < size; row++) {
        for (let column = 0; column < size; column++, at += 3) {
          const [x, y, z] = direction((2 * column + 1) / size - 1, (2 * row + 1) / size - 1);
          const length = Math.hypot(x, y, z);
          directions.set([-x / length, y / length, z / length], at);
        }
      }
    }
    lookups.set(key, lookupOf(height, directions));
  }
  return lookups.get(key);
}

function sample(map, height, size) {
  const faces = new Float32Array(24 * size * size).fill(1);
  readMap(map, texels(height, size), faces, 4);
  for (let i = 0; i < faces.length; i++) if (faces[i] > HALF_MAX) faces[i] = HALF_MAX;
  return faces;
}

/** Faces of half the side. */
function meanOfFours(faces, size) {
  const half = size / 2;
  const means = new Float32Array(faces.length / 4);
  let to = 0;
  for (let row = 0; row < 6 * half; row++) { // the faces lie below each other
    for (let column = 0; column < half; column++) {
      const from = 4 * (2 * row * size + 2 * column);
      for (let c = 0; c < 4; c++, to++) {
        means[to] = (faces[from + c] + faces[from + 4 + c] + faces[from + 4 * size + c] + faces[from + 4 * size + 4 + c]) / 4;
      }
    }
  }
  return means;
}
