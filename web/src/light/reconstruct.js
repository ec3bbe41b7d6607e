/** From the LDR map and the log map to HDR radiance: paper Eq. 7 and 8, as anyprobe.light.reconstruct. */

import { CONTRACT } from "../core/contract.js";
import { inverseResponse } from "../core/response.js";

/** tau of Eq. 8. */
export const THRESHOLD = CONTRACT.graph.blend_from;

/** Largest ln radiance that is kept: a little below the largest half float. */
export const LN_MAX = CONTRACT.graph.ln_most;

/**
 * R = (1 - gamma) f^-1(U) + gamma exp(H), with the natural logarithm.
 *
 * @param {Float32Array} ldr display values, any number of pixels of three channels
 * @param {Float32Array} lnRadiance the same size
 * @returns {Float32Array} linear radiance in the photo's exposure units
 */
export function reconstruct(ldr, lnRadiance) {
  const radiance = new Float32Array(ldr.length);
  for (let i = 0; i < ldr.length; i += 3) {
    const brightest = Math.min(Math.max(ldr[i], ldr[i + 1], ldr[i + 2], 0), 1);
    const gamma = Math.max(brightest - THRESHOLD, 0) / (1 - THRESHOLD);
    for (let channel = i; channel < i + 3; channel++) {
      radiance[channel] =
        (1 - gamma) * inverseResponse(ldr[channel]) + gamma * Math.exp(Math.min(lnRadiance[channel], LN_MAX));
    }
  }
  return radiance;
}
