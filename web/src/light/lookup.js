/** Read maps in many directions at once; the four pixels around each direction are found once. */

import { directionToUv } from "../core/latlong.js";

/**
 * @typedef {object} Lookup
 * @property {Int32Array} pixels four a direction: where their red stands in a map
 * @property {Float32Array} shares of those four
 */

/**
 * @param {number} height rows of the map that will be read
 * @param {ArrayLike<number>} directions unit vectors, three numbers each
 * @returns {Lookup} wraps in longitude, clamps at the poles
 */
export function lookupOf(height, directions) {
  const width = 2 * height;
  const count = directions.length / 3;
  const pixels = new Int32Array(4 * count);
  const shares = new Float32Array(4 * count);
  for (let from = 0, at = 0; at < pixels.length; from += 3, at += 4) {
    const [u, v] = directionToUv(directions[from], directions[from + 1], directions[from + 2]);
    const across = u * width - 0.5;
    const down = Math.min(Math.max(v * height - 0.5, 0), height - 1);
    const column = Math.floor(across);
    const row = Math.floor(down);
    const right = across - column;
    const lower = down - row;
    const columns = [(column + width) % width, (column + 1 + width) % width];
    const rows = [row, Math.min(row + 1, height - 1)];
    for (let corner = 0; corner < 4; corner++) {
      pixels[at + corner] = 3 * (rows[corner >> 1] * width + columns[corner & 1]);
      shares[at + corner] = (corner & 1 ? right : 1 - right) * (corner >> 1 ? lower : 1 - lower);
    }
  }
  return { pixels, shares };
}

/**
 * Read a map in those directions.
 *
 * @param {Float32Array} map of three channels
 * @param {Lookup} lookup
 * @param {Float32Array} out three numbers a direction, `stride` apart
 */
export function readMap(map, { pixels, shares }, out, stride = 3) {
  for (let at = 0, to = 0; at < pixels.length; at += 4, to += stride) {
    const a = pixels[at];
    const b = pixels[at + 1];
    const c = pixels[at + 2];
    const d = pixels[at + 3];
    const ofA = shares[at];
    const ofB = shares[at + 1];
    const ofC = shares[at + 2];
    const ofD = shares[at + 3];
    out[to] = ofA * map[a] + ofB * map[b] + ofC * map[c] + ofD * map[d];
    out[to + 1] = ofA * map[a + 1] + ofB * map[b + 1] + ofC * map[c + 1] + ofD * map[d + 1];
    out[to + 2] = ofA * map[a + 2] + ofB * map[b + 2] + ofC * map[c + 2] + ofD * map[d + 2];
  }
  return out;
}
