/**
 * The equirectangular map: H x 2H, row 0 up (+Y), the centre column is -Z.
 *
 * u = 0.5 + atan2(x, -z) / 2 pi and v = acos(y) / pi; pixel centres at (i + 0.5) / N.
 * A map is a Float32Array of H * 2H * 3 numbers, row by row, channel last.
 */

import { CONTRACT } from "./contract.js";

/** Rows of every estimated map. */
export const MAP_HEIGHT = CONTRACT.sizes.map_height;

/** Unit direction to [u, v], each in [0, 1]. */
export function directionToUv(x, y, z) {
  return [0.5 + Math.atan2(x, -z) / (2 * Math.PI), Math.acos(Math.min(Math.max(y, -1), 1)) / Math.PI];
}

/** [u, v] to a unit direction; inverse of directionToUv. */
export function uvToDirection(u, v) {
  const phi = 2 * Math.PI * (u - 0.5);
  const theta = Math.PI * v;
  const sine = Math.sin(theta);
  return [sine * Math.sin(phi), Math.cos(theta), -sine * Math.cos(phi)];
}

const directions = new Map();

/** Direction of every pixel centre, H * 2H * 3 numbers; kept for the next call. */
export function pixelDirections(height) {
  if (!directions.has(height)) {
    const made = new Float32Array(height * 2 * height * 3);
    for (let row = 0; row < height; row++) {
      for (let column = 0; column < 2 * height; column++) {
        made.set(uvToDirection((column + 0.5) / (2 * height), (row + 0.5) / height), 3 * (row * 2 * height + column));
      }
    }
    directions.set(height, made);
  }
  return directions.get(height);
}

const solidAngles = new Map();

/** Solid angle [sr] of a pixel of each row, exact band integral: 2H times the sum is 4 pi; kept for the next call. */
export function pixelSolidAngles(height) {
  if (!solidAngles.has(height)) {
    const edge = (row) => Math.cos((Math.PI * row) / height);
    const angleOf = (_, row) => ((edge(row) - edge(row + 1)) * Math.PI) / height;
    solidAngles.set(height, Float32Array.from({ length: height }, angleOf));
  }
  return solidAngles.get(height);
}
