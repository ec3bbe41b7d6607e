/** Operations on a whole radiance map. */

import { pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { lookupOf, readMap } from "./lookup.js";

let lastTurn = { height: 0, rotation: [], lookup: null };

/**
 * The map seen after the world is turned: new(d) = old(rotation^T d).
 *
 * @param {Float32Array} radiance H * 2H * 3
 * @param {number[]} rotation nine numbers, row by row
 * @returns {Float32Array}
 */
export function rotate(radiance, height, rotation) {
  return readMap(radiance, lookupOfTurn(height, rotation), new Float32Array(radiance.length));
}

/** The same for one number a pixel. */
export function rotateOne(values, height, rotation) {
  const alike = Float32Array.from({ length: 3 * values.length }, (_, i) => values[Math.floor(i / 3)]);
  return rotate(alike, height, rotation).filter((_, i) => i % 3 === 0);
}

function lookupOfTurn(height, rotation) {
  if (height !== lastTurn.height || rotation.some((value, i) => value !== lastTurn.rotation[i])) {
    lastTurn = { height, rotation: [...rotation], lookup: lookupOf(height, turnedBack(height, rotation)) };
  }
  return lastTurn.lookup;
}

/** rotation^T d of every pixel's direction d. */
function turnedBack(height, [a, b, c, e, f, g, h, i, j]) {
  const d = pixelDirections(height);
  const turned = new Float64Array(d.length);
  for (let at = 0; at < d.length; at += 3) {
    const [x, y, z] = [d[at], d[at + 1], d[at + 2]];
    turned[at] = a * x + e * y + h * z;
    turned[at + 1] = b * x + f * y + i * z;
    turned[at + 2] = c * x + g * y + j * z;
  }
  return turned;
}

/** The map at half its height, averaged by solid angle. */
export function halve(radiance, height) {
  const weights = pixelSolidAngles(height);
  const half = new Float32Array(radiance.length / 4);
  const line = 6 * height;
  let to = 0;
  for (let row = 0; row < height; row += 2) {
    const [upper, lower] = [weights[row], weights[row + 1]];
    const scale = 1 / (2 * (upper + lower));
    for (let column = 0; column < 2 * height; column += 2) {
      const at = row * line + 3 * column;
      for (let c = at; c < at + 3; c++, to++) {
        const above = radiance[c] + radiance[c + 3];
        const below = radiance[c + line] + radiance[c + line + 3];
        half[to] = scale * (upper * above + lower * below);
      }
    }
  }
  return half;
}
