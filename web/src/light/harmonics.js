/**
 * Real spherical harmonics to order 2 of radiance, nine numbers a channel.
 *
 * Order and constants of WebXR and three.js: 1, y, z, x, xy, yz, 3z^2 - 1, xz, x^2 - y^2. Not by three.js's
 * LightProbeGenerator: it sums samples of a cube that a renderer has drawn, which this thread has none of, where this is the
 * integral over the map.
 */

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

/** Differences of a function at the edges of n pixels between two angles. */
function differences(antiderivative, from, to, n) {
  const step = (to - from) / n;
  return Float64Array.from(
    { length: n },
    (_, i) => antiderivative(from + step * (i + 1)) - antiderivative(from + step * i),
  );
}

const integrals = new Map();

/** Integral of Y_i over every pixel, in closed form, nine arrays of H * 2H; kept for the next call. */
function pixelIntegrals(height) {
  if (integrals.has(height)) return integrals.get(height);
  const { sin, cos } = Math;
  const over_t = (f) => differences(f, 0, PI, height);
  const over_p = (f) => differences(f, -PI, PI, 2 * height);
  const t = { // antiderivatives over t of sin t times 1, cos t, sin t, ...
    one: over_t((a) => -cos(a)),
    y: over_t((a) => sin(a) ** 2 / 2),
    s: over_t((a) => a / 2 - sin(2 * a) / 4),
    sy: over_t((a) => sin(a) ** 3 / 3),
    ss: over_t((a) => cos(a) ** 3 / 3 - cos(a)),
    yy: over_t((a) => -(cos(a) ** 3) / 3),
  };
  const p = {
    one: over_p((a) => a),
    sin: over_p((a) => -cos(a)),
    cos: over_p((a) => sin(a)),
    sin2: over_p((a) => a / 2 - sin(2 * a) / 4),
    cos2: over_p((a) => a / 2 + sin(2 * a) / 4),
    sincos: over_p((a) => sin(a) ** 2 / 2),
  };
  const value = [
    (i, j) => t.one[i] * p.one[j],
    (i, j) => t.y[i] * p.one[j],
    (i, j) => -t.s[i] * p.cos[j],
    (i, j) => t.s[i] * p.sin[j],
    (i, j) => t.sy[i] * p.sin[j],
    (i, j) => -t.sy[i] * p.cos[j],
    (i, j) => 3 * t.ss[i] * p.cos2[j] - t.one[i] * p.one[j],
    (i, j) => -t.ss[i] * p.sincos[j],
    (i, j) => t.ss[i] * p.sin2[j] - t.yy[i] * p.one[j],
  ];
  const width = 2 * height;
  const made = value.map((f, k) =>
    Float64Array.from({ length: height * width }, (_, at) => K[k] * f(Math.floor(at / width), at % width)),
  );
  integrals.set(height, made);
  return made;
}

/** Radiance coefficients L_i of a map, 27 numbers, coefficient by coefficient, RGB inside. */
export function project(radiance, height) {
  const coefficients = new Float32Array(27);
  pixelIntegrals(height).forEach((weights, i) => {
    let [red, green, blue] = [0, 0, 0];
    for (let pixel = 0, at = 0; pixel < weights.length; pixel++, at += 3) {
      const weight = weights[pixel];
      red += weight * radiance[at];
      green += weight * radiance[at + 1];
      blue += weight * radiance[at + 2];
    }
    coefficients.set([red, green, blue], 3 * i);
  });
  return coefficients;
}

/** By how much a normal's length may be another than 1. */
const MOST_OFF = 0.01;

const wrong = (name, expected, got) => new AnyProbeError("invalid-option", `expected ${expected}, got ${got}`, { subject: [name] });

/** E(n) = sum of A_l L_i Y_i(n), [r, g, b]. */
export function irradiance(coefficients, normal) {
  if (coefficients?.length !== 27) throw wrong("sh9", "27 numbers, such as light.sh9", coefficients?.length ?? typeof coefficients);
  const isUnit = normal?.length === 3 && Math.abs(Math.hypot(...normal) - 1) <= MOST_OFF;
  if (!isUnit) throw wrong("normal", "[x, y, z] of length 1", normal?.length ? `[${[...normal].join(", ")}]` : typeof normal);
  const sum = [0, 0, 0];
  shBasis(...normal).forEach((y, i) => {
    for (let channel = 0; channel < 3; channel++) {
      sum[channel] += COSINE_LOBE[i] * coefficients[3 * i + channel] * y;
    }
  });
  return sum;
}
