/**
 * The camera's curve: scene radiance to display value, and back.
 *
 * f(x) = (1 + sigma) x^n / (x^n + sigma), the mean of the fitted family, as in anyprobe.core.response.
 */

import { CONTRACT } from "./contract.js";

export const { exponent: EXPONENT, sigma: SIGMA } = CONTRACT.curve;

/** Radiance in the photo's exposure units to a display value in [0, 1]; 1 and more clips. */
export function response(radiance) {
  const x = Math.pow(Math.min(Math.max(radiance, 0), 1), EXPONENT);
  return ((1 + SIGMA) * x) / (x + SIGMA);
}

/** Steps of the table below, fine enough for eight bits: neighbours differ by less than half a byte. */
const STEPS = 4096;

const bytes = Uint8ClampedArray.from({ length: STEPS + 1 }, (_, i) => 255 * response(i / STEPS));

/** Radiance to the display value as a byte, for pictures on the screen. */
export function displayByte(radiance) {
  return bytes[radiance >= 1 ? STEPS : radiance > 0 ? (radiance * STEPS + 0.5) | 0 : 0];
}

/** Display value to radiance in [0, 1]. */
export function inverseResponse(display) {
  const y = Math.min(Math.max(display, 0), 1);
  return Math.pow((SIGMA * y) / (1 + SIGMA - y), 1 / EXPONENT);
}
