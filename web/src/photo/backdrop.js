/** Whether what is beside the object is a place under its light, a cut-out's backdrop or dark, as anyprobe.estimate.surroundings. */

import { luminance } from "../core/color.js";
import { CONTRACT } from "../core/contract.js";
import { notice } from "../notices.js";
import { median } from "./ground.js";

/** Added to the normal equations of a backdrop's shading, so that few pixels have one too. */
const BACKDROP_DAMPING = 1e-6;

/**
 * Whether a picture shows no place beside its object: it is transparent there, or but for flaws of one colour or of a
 * backdrop's smooth shading, a quadratic of the place in the picture.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 */
export function isCutOut({ width, height, rgba }, mask) {
  const step = Math.max(1, Math.floor(Math.max(width, height) / CONTRACT.ground.samples));
  const beside = [[], [], []];
  const terms = [];
  const [rows, columns] = [Math.ceil(height / step), Math.ceil(width / step)];
  let transparent = 0;
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) {
      const pixel = y * width + x;
      if (mask[pixel] >= 0.5) continue;
      if (rgba[4 * pixel + 3] < 128) transparent++;
      const [u, v] = [(2 * (x / step)) / Math.max(columns - 1, 1) - 1, (2 * (y / step)) / Math.max(rows - 1, 1) - 1];
      terms.push([1, u, v, u * u, u * v, v * v]);
      for (let channel = 0; channel < 3; channel++) beside[channel].push(rgba[4 * pixel + channel] / 255);
    }
  }
  const count = beside[0].length;
  if (transparent >= 0.5 * count) return true;
  const middle = beside.map(median);
  const shading = backdropOf(terms, beside);
  const isPlain = (fit) => {
    let plain = 0;
    for (let i = 0; i < count; i++) {
      if (beside.every((values, channel) => Math.abs(values[i] - fit(i, channel)) <= CONTRACT.ground.plain_step)) plain++;
    }
    return plain >= CONTRACT.ground.plain_share * count;
  };
  if (isPlain((_, channel) => middle[channel])) return true;
  return isPlain((i, channel) => terms[i].reduce((sum, term, k) => sum + term * shading[channel][k], 0));
}

/**
 * Whether what is beside the object is much darker than it, as in a dark room or before black cloth: it then tells nothing
 * of the light.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 */
export function isDarkBeside({ width, height, rgba }, mask) {
  const step = Math.max(1, Math.floor(Math.max(width, height) / CONTRACT.ground.samples));
  const [sums, counts] = [[0, 0], [0, 0]]; // beside the object, and on it
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) {
      const pixel = y * width + x;
      const which = mask[pixel] >= 0.5 ? 1 : 0;
      sums[which] += luminance(rgba[4 * pixel], rgba[4 * pixel + 1], rgba[4 * pixel + 2]);
      counts[which]++;
    }
  }
  if (counts[0] === 0 || counts[1] === 0) return false;
  return sums[0] / counts[0] < CONTRACT.ground.dark_beside * (sums[1] / counts[1]);
}

/**
 * A line where what is beside the object of an opaque cut-out is bright enough for a studio's backdrop;
 * anyprobe.estimate.doubts has the same.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 * @returns {import("../notices.js").Notice[]}
 */
export function backdropDoubts({ width, height, rgba }, mask) {
  const step = Math.max(1, Math.floor(Math.max(width, height) / CONTRACT.ground.samples));
  const levels = [];
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) {
      const at = 4 * (y * width + x);
      if (mask[at / 4] >= 0.5) continue;
      if (rgba[at + 3] < 128) return [];
      levels.push(luminance(rgba[at], rgba[at + 1], rgba[at + 2]) / 255);
    }
  }
  if (levels.length === 0 || median(levels) <= CONTRACT.ground.backdrop_level) return [];
  const text = "the background is of one colour, as a cut-out's, and is not used; if it is real, ask for it";
  return [notice("plain-backdrop", text, [{ do: "give", name: "surroundings", value: "photo" }])];
}

/**
 * A line where what is beside the object is much darker than it; anyprobe.estimate.doubts has the same.
 *
 * @returns {import("../notices.js").Notice[]}
 */
export function darkBesideDoubts() {
  const text = "the background is much darker than the object, so it is ignored; if the same light falls on it, ask for it";
  return [notice("dark-backdrop", text, [{ do: "give", name: "surroundings", value: "photo" }])];
}

/** Coefficients, per channel, of the terms [N][6] that are nearest to the values [3][N]: by elimination. */
function backdropOf(terms, values) {
  const size = 6;
  const rows = Array.from({ length: size }, (_, k) => {
    const row = new Float64Array(size + 3);
    for (let i = 0; i < terms.length; i++) {
      for (let l = 0; l < size; l++) row[l] += terms[i][k] * terms[i][l];
      for (let channel = 0; channel < 3; channel++) row[size + channel] += terms[i][k] * values[channel][i];
    }
    row[k] += BACKDROP_DAMPING;
    return row;
  });
  for (let k = 0; k < size; k++) {
    for (let l = 0; l < size; l++) {
      if (l === k) continue;
      const share = rows[l][k] / rows[k][k]; // positive definite: no pivot is zero
      for (let at = k; at < size + 3; at++) rows[l][at] -= share * rows[k][at];
    }
  }
  return [0, 1, 2].map((channel) => rows.map((row, k) => row[size + channel] / row[k]));
}
