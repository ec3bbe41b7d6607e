/** Inputs and outputs of light.onnx, which holds the whole way from a picture's pixels to its light; as anyprobe.estimate.light_graph. */

import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT } from "../core/latlong.js";
import { objectBox } from "../photo/picture.js";

/** In the graph's order; each has a batch of one. */
export const INPUTS = ["photo", "window", "geometry", "lens", "up", "normals", "material", "panorama", "sun", "believe"];

/** Longest sides of the photo and of the window, in pixels. */
const { photo_side: PHOTO_SIDE, window_side: WINDOW_SIDE } = CONTRACT.graph;

/** Side of the square around the object over the longer side of its box. */
const MARGIN = CONTRACT.sizes.crop_margin;

/**
 * @typedef {object} Given what is known of a picture beside its object's mask
 * @property {boolean} [isLensKnown] whether the field of view is the picture's own
 * @property {(pixel: number) => number} [coverOf] 1 where a pixel beside the object may be used, else 0; default: everywhere
 * @property {number[] | null} [up] [3] away from the ground, camera frame
 * @property {Float32Array | null} [normals] [height, width, 3] of the object, camera frame, unit, zero where unknown
 * @property {Float32Array | null} [material] [8] of materialInput
 * @property {boolean} [believe] the background is used whatever it looks like
 */

/** Values and shape of each input, by name. @param {Given} [given] @returns {Record<string, [Float32Array, number[]]>} */
export function graphInputs(picture, mask, longFovDeg, { isLensKnown = false, coverOf = () => 1, up, normals, material, believe = false } = {}) {
  const { width, height, rgba } = picture;
  const k = Math.ceil(Math.max(width, height) / PHOTO_SIDE);
  const [x0, y0, x1, y1] = windowBox(mask, width);
  const s = Math.ceil(Math.max(x1 - x0, y1 - y0) / WINDOW_SIDE);
  const columns = samples(x0, x1, s);
  const rows = samples(y0, y1, s);
  const near = new Float32Array(4 * rows.length * columns.length);
  const around = new Float32Array(normals ? 3 * rows.length * columns.length : 3);
  let count = 0;
  for (const y of rows) {
    for (const x of columns) {
      const pixel = y * width + x;
      for (let c = 0; c < 3; c++) near[4 * count + c] = rgba[4 * pixel + c] / 255;
      near[4 * count + 3] = mask[pixel];
      if (normals) for (let axis = 0; axis < 3; axis++) around[3 * count + axis] = normals[3 * pixel + axis] * mask[pixel];
      count++;
    }
  }
  const [down, across] = [Math.ceil(height / k), Math.ceil(width / k)];
  return {
    photo: [blockMeans(picture, mask, coverOf, k), [1, down, across, 5]],
    window: [near, [1, rows.length, columns.length, 4]],
    geometry: [Float32Array.of(width, height, k, x0, y0, s), [1, 6]],
    lens: [Float32Array.of(Math.tan((longFovDeg * Math.PI) / 360), Number(isLensKnown)), [1, 2]],
    up: [Float32Array.from(up ?? [0, 0, 0]), [1, 3]],
    normals: [around, normals ? [1, rows.length, columns.length, 3] : [1, 1, 1, 3]],
    material: [material ?? new Float32Array(CONTRACT.materials.inputs), [1, CONTRACT.materials.inputs]],
    panorama: [new Float32Array(8 * MAP_HEIGHT * MAP_HEIGHT), [1, MAP_HEIGHT, 2 * MAP_HEIGHT, 4]],
    sun: [new Float32Array(3), [1, 3]],
    believe: [Float32Array.of(Number(believe)), [1, 1]],
  };
}

/** Left, top, right, bottom of the square around the object, as far as the picture goes. */
function windowBox(mask, width) {
  const box = objectBox(mask, width);
  if (!box) return [0, 0, 1, 1];
  const [x0, y0, x1, y1] = box;
  const half = (MARGIN * Math.max(x1 - x0, y1 - y0)) / 2;
  const [x, y] = [(x0 + x1) / 2, (y0 + y1) / 2];
  const least = (at) => Math.max(Math.floor(at - half), 0);
  const most = (at, length) => Math.min(Math.ceil(at + half), length);
  return [least(x), least(y), most(x, width), most(y, mask.length / width)];
}

/** Every s-th from the middle of the first s on. */
function samples(from, until, s) {
  const first = from + Math.floor(s / 2);
  return Array.from({ length: Math.max(Math.ceil((until - first) / s), 0) }, (_, i) => first + i * s);
}

/** Display RGB times cover, cover and mask, means over k x k pixels; the last blocks are cut at the border. */
function blockMeans({ width, height, rgba }, mask, coverOf, k) {
  const [down, across] = [Math.ceil(height / k), Math.ceil(width / k)];
  const means = new Float32Array(5 * down * across);
  const line = new Float64Array(5 * across);
  for (let row = 0; row < down; row++) {
    const bottom = Math.min((row + 1) * k, height);
    line.fill(0);
    for (let y = row * k; y < bottom; y++) {
      for (let x = 0, pixel = y * width; x < width; x++, pixel++) {
        const to = 5 * Math.floor(x / k);
        const cover = Math.max(coverOf(pixel), mask[pixel]);
        for (let c = 0; c < 3; c++) line[to + c] += cover * rgba[4 * pixel + c];
        line[to + 3] += cover;
        line[to + 4] += mask[pixel];
      }
    }
    for (let column = 0, at = 5 * row * across; column < across; column++, at += 5) {
      const count = (bottom - row * k) * (Math.min((column + 1) * k, width) - column * k);
      for (let c = 0; c < 5; c++) means[at + c] = line[5 * column + c] / count / (c < 3 ? 255 : 1);
    }
  }
  return means;
}
