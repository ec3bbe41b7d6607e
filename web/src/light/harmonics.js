/**
 * Real spherical harmonics to order 2 of radiance, nine numbers a channel.
 *
 * Order and constants of WebXR and three.js: 1, y, z, x, xy, yz, 3z^2 - 1, xz, x^2 - y^2. three.js's own generator reads cubes
 * that a renderer has drawn, of which this thread has none.
 */

import { luminance } from "../core/color.js";
import { pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { AnyProbeError } from "../errors.js";

const { PI, sqrt } = Math;

const K = [
  sqrt(1 / (4 * PI)),
  ...new Array(3).fill(sqrt(3 / (4 * PI))),
  ...new Array(2).fill(sqrt(15 / (4 * PI))),
  sqrt(5 / (16 * PI)),
  sqrt(15 / (4 * PI)),
  sqrt(15 / (16 * PI)),
];

/** A_l of max(0, cos): pi, 2 pi / 3, pi / 4. */
const COSINE_LOBE = [PI, ...new Array(3).fill((2 * PI) / 3), ...new Array(5).fill(PI / 4)];

/** Y_i at a unit direction. */
export function shBasis(x, y, z) {
  const polynomials = [1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y];
  return polynomials.map((value, i) => value * K[i]);
}

const weights = new Map();

/** Y_i times the solid angle of every pixel, nine arrays of H * 2H; kept for the next call. */
function pixelWeights(height) {
  if (weights.has(height)) return weights.get(height);
  const [d, angles] = [pixelDirections(height), pixelSolidAngles(height)];
  const made = K.map(() => new Float64Array(2 * height * height));
  for (let pixel = 0; pixel < made[0].length; pixel++) {
    const basis = shBasis(d[3 * pixel], d[3 * pixel + 1], d[3 * pixel + 2]);
    basis.forEach((value, i) => (made[i][pixel] = value * angles[Math.floor(pixel / (2 * height))]));
  }
  weights.set(height, made);
  return made;
}

/** Radiance coefficients L_i of a map, 27 numbers, coefficient by coefficient, RGB inside. */
export function project(radiance, height) {
  const coefficients = new Float32Array(27);
  pixelWeights(height).forEach((ofTerm, i) => {
    let [red, green, blue] = [0, 0, 0];
    for (let pixel = 0, at = 0; pixel < ofTerm.length; pixel++, at += 3) {
      const weight = ofTerm[pixel];
      red += weight * radiance[at];
      green += weight * radiance[at + 1];
      blue += weight * radiance[at + 2];
    }
    coefficients.set([red, green, blue], 3 * i);
  });
  return coefficients;
}

/** Tolerance of a normal's length. */
const MOST_OFF = 0.01;

const wrong = (name, expected, got) => new AnyProbeError("invalid-option", `expected ${expected}, got ${got}`, { subject: [name] });

/** E(n) = sum of A_l L_i Y_i(n), [r, g, b]. */
export function irradiance(coefficients, normal) {
  if (coefficients?.length !== 27) throw wrong("sh9", "27 numbers, such as light.sh9", coefficients?.length ?? typeof coefficients);
  const isUnit = normal?.length === 3 && Math.abs(Math.hypot(...normal) - 1) <= MOST_OFF;
  if (!isUnit) throw wrong("normal", "[x, y, z] of length 1", normal?.length ? `[${[...normal].join(", ")}]` : typeof normal);
  const sum = [0, 0, 0];
  shBasis(...normal).forEach((y, i) => {
    for (let channel = 0; channel < 3; channel++) sum[channel] += COSINE_LOBE[i] * coefficients[3 * i + channel] * y;
  });
  return sum;
}

/** |integral of L d dw| / integral of L dw of luminance: 0, even light, to 1, one direction. */
export function directionality(sh9) {
  const [all, ...moment] = [0, 1, 2, 3].map((i) => luminance(...sh9.subarray(3 * i, 3 * i + 3)) / K[i]);
  return all > 0 ? Math.hypot(...moment) / all : 0;
}
