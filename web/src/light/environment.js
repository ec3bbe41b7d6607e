/** Operations on a whole radiance map. */

import { bilinear, directionToUv, pixelDirections } from "../core/latlong.js";

/**
 * The map seen after the world is turned: new(d) = old(rotation^T d).
 *
 * @param {Float32Array} radiance H * 2H * 3
 * @param {number} height
 * @param {number[]} rotation nine numbers, row by row
 * @returns {Float32Array}
 */
export function rotate(radiance, height, rotation) {
  const turned = new Float32Array(radiance.length);
  const d = pixelDirections(height);
  const [a, b, c, e, f, g, h, i, j] = rotation;
  for (let at = 0; at < d.length; at += 3) {
    const [x, y, z] = [d[at], d[at + 1], d[at + 2]];
    const [u, v] = directionToUv(a * x + e * y + h * z, b * x + f * y + i * z, c * x + g * y + j * z);
    bilinear(radiance, height, u, v, turned, at);
  }
  return turned;
}
