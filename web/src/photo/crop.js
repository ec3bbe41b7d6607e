/** The square crop around the object that the networks see, as anyprobe.estimate.photo.crop_object. */

import { CONTRACT } from "../core/contract.js";
import { turnTowards } from "../core/frames.js";
import { objectBox } from "./picture.js";

/** Side of the window in samples: what the networks take. */
export const CROP_SIZE = CONTRACT.sizes.crop;

/** Side of the window in which normals are given. */
export const NORMALS_SIZE = CONTRACT.sizes.normals;

/** A mean of normals shorter than this is none. */
const SHORTEST_NORMAL = CONTRACT.graph.shortest_normal;

/** Field of view [degrees] of the longer side where nothing else is known: a phone's main camera. */
export const DEFAULT_LONG_FOV_DEG = CONTRACT.lens.default_long_fov_deg;

/** Side of the picture of what lies around the object. */
export const CONTEXT_SIZE = CONTRACT.sizes.context;
const { context_scale: CONTEXT_SCALE, context_fine: CONTEXT_FINE } = CONTRACT.sizes;

const MARGIN = CONTRACT.sizes.crop_margin;

/**
 * Cut a square around the object and bring it to CROP_SIZE x CROP_SIZE.
 *
 * Averaged over areas when shrinking, bilinear when enlarging, colour premultiplied by the mask.
 * What lies over the border of the picture is empty.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 * @param {number} longFovDeg field of view of the longer side
 * @param {number[]} [box] of the mask's object, where it is known already
 * @returns {{image: Float32Array, cameraFromCrop: number[], sidePx: number, centerPx: number[],
 *   tanHalf: number, mask: Float32Array, box: number[]}}
 *   image is [4, 128, 128] channel first, red, green, blue, mask in [0, 1]; cameraFromCrop turns
 *   the frame that looks at the window's centre along -Z to the camera's; tanHalf is the tangent of
 *   half the angle that the window's side takes in; mask and box are the picture's
 */
export function cropObject({ width, height, rgba }, mask, longFovDeg = DEFAULT_LONG_FOV_DEG, box = objectBox(mask, width)) {
  const [x0, y0, x1, y1] = box;
  const centerPx = [(x0 + x1) / 2, (y0 + y1) / 2];
  const sidePx = MARGIN * Math.max(x1 - x0, y1 - y0);
  const columns = resampling(centerPx[0] - sidePx / 2, sidePx, width);
  const rows = resampling(centerPx[1] - sidePx / 2, sidePx, height);

  const image = resampled(columns, rows, width, 4, (sums, to, weights, from, until, pixel) => {
    let red = 0;
    let green = 0;
    let blue = 0;
    let cover = 0;
    for (let i = from; i < until; i++, pixel++) {
      const share = weights[i] * mask[pixel];
      if (share === 0) continue;
      red += share * rgba[4 * pixel];
      green += share * rgba[4 * pixel + 1];
      blue += share * rgba[4 * pixel + 2];
      cover += share;
    }
    sums[to] = red / 255;
    sums[to + 1] = green / 255;
    sums[to + 2] = blue / 255;
    sums[to + 3] = cover;
  }).map(clamped);
  const ray = pixelDirection(centerPx, width, height, longFovDeg);
  // away from the picture's centre a pixel takes in less: by cos^2 along the radius, by cos across it
  const tanHalf = (sidePx / 2 / focalPx(width, height, longFovDeg)) * Math.hypot(...ray) ** -1.5;
  return { image, cameraFromCrop: turnTowards(ray), sidePx, centerPx, tanHalf, mask, box };
}

/**
 * The picture CONTEXT_SCALE times as wide as the crop: display RGB, the object's mask, and where the picture is.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 * @param {ReturnType<typeof cropObject>} crop
 * @param {import("./picture.js").Picture | null} [opaque] of withoutTransparent
 * @returns {Float32Array} [5, 96, 96] in [0, 1], all zero outside the picture
 */
export function contextOf({ width, height, rgba }, mask, { centerPx, sidePx }, opaque = null) {
  const wide = CONTEXT_SCALE * sidePx;
  const step = Math.max(1, Math.floor(wide / CONTEXT_SIZE / CONTEXT_FINE)); // of large pictures not every pixel is looked at
  const [high, side] = [Math.ceil(height / step), wide / step];
  const columns = resampling(centerPx[0] / step - side / 2, side, Math.ceil(width / step), CONTEXT_SIZE);
  const rows = resampling(centerPx[1] / step - side / 2, side, high, CONTEXT_SIZE);
  const add = (sums, to, weights, from, until, pixel) => {
    let red = 0;
    let green = 0;
    let blue = 0;
    let cover = 0;
    let inside = 0;
    for (let i = from; i < until; i++, pixel += step) {
      const weight = weights[i];
      red += weight * rgba[4 * pixel];
      green += weight * rgba[4 * pixel + 1];
      blue += weight * rgba[4 * pixel + 2];
      cover += weight * mask[pixel];
      inside += opaque ? (weight * opaque.rgba[4 * pixel]) / 255 : weight;
    }
    sums[to] = red / 255;
    sums[to + 1] = green / 255;
    sums[to + 2] = blue / 255;
    sums[to + 3] = cover;
    sums[to + 4] = inside;
  };
  return resampled(columns, rows, width, 5, add, step).map(clamped);
}

/**
 * Normals of a picture in the crop's window and frame.
 *
 * @param {Float32Array} normals [height, width, 3] in the camera's frame, unit, zero where they are not known
 * @param {Float32Array} mask
 * @param {number} width of the picture
 * @param {ReturnType<typeof cropObject>} crop
 * @returns {Float32Array} [3, 64, 64] unit or zero
 */
export function cropNormals(normals, mask, width, { cameraFromCrop, centerPx, sidePx }) {
  const columns = resampling(centerPx[0] - sidePx / 2, sidePx, width, NORMALS_SIZE);
  const rows = resampling(centerPx[1] - sidePx / 2, sidePx, mask.length / width, NORMALS_SIZE);
  const cropped = resampled(columns, rows, width, 3, (sums, to, weights, from, until, pixel) => {
    for (let i = from; i < until; i++, pixel++) {
      for (let axis = 0; axis < 3; axis++) sums[to + axis] += weights[i] * mask[pixel] * normals[3 * pixel + axis];
    }
  });
  const plane = NORMALS_SIZE * NORMALS_SIZE;
  const [a, b, c, d, e, f, g, h, i] = cameraFromCrop;
  for (let at = 0; at < plane; at++) {
    const [x, y, z] = [cropped[at], cropped[plane + at], cropped[2 * plane + at]];
    const length = Math.hypot(x, y, z);
    const turned = [a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z]; // by the inverse
    turned.forEach((value, axis) => (cropped[axis * plane + at] = length > SHORTEST_NORMAL ? value / length : 0));
  }
  return cropped;
}

/** Focal length of a pinhole picture in pixels. */
export function focalPx(width, height, longFovDeg) {
  return Math.max(width, height) / 2 / Math.tan((longFovDeg * Math.PI) / 360);
}

/** Direction, camera frame, through the point x, y of a pinhole picture; not of unit length. */
export function pixelDirection([x, y], width, height, longFovDeg) {
  const focal = focalPx(width, height, longFovDeg);
  return [(x - width / 2) / focal, -(y - height / 2) / focal, -1];
}

const clamped = (value) => Math.min(Math.max(value, 0), 1);

/**
 * A window of a picture, first every row of it to its columns, then those to its rows.
 *
 * @param {ReturnType<typeof resampling>} columns
 * @param {ReturnType<typeof resampling>} rows
 * @param {number} width of the picture
 * @param {number} channels
 * @param {(sums: Float64Array, to: number, weights: Float32Array, from: number, until: number, pixel: number) => void} add
 *   what pixels from `pixel` on have by these weights, to the sums from `to` on
 * @param {number} [step] only every so many pixels are looked at, both ways
 * @returns {Float32Array} channel first
 */
function resampled(columns, rows, width, channels, add, step = 1) {
  const size = columns.from.length;
  const line = channels * size;
  const narrow = new Float64Array((rows.last - rows.first) * line);
  for (let y = rows.first, to = 0; y < rows.last; y++) {
    for (let sample = 0; sample < size; sample++, to += channels) {
      const pixel = step * (y * width + columns.from[sample]);
      add(narrow, to, columns.weights, columns.start[sample], columns.start[sample + 1], pixel);
    }
  }
  const planes = new Float32Array(line * size);
  const sums = new Float64Array(line);
  for (let sample = 0; sample < size; sample++) {
    sums.fill(0);
    let from = (rows.from[sample] - rows.first) * line;
    for (let i = rows.start[sample]; i < rows.start[sample + 1]; i++, from += line) {
      const weight = rows.weights[i];
      for (let at = 0; at < line; at++) sums[at] += weight * narrow[from + at];
    }
    for (let channel = 0; channel < channels; channel++) {
      let to = (channel * size + sample) * size;
      for (let at = channel; at < line; at += channels, to++) planes[to] = sums[at];
    }
  }
  return planes;
}

/**
 * Which pixels every sample of the window [begin, begin + side) reads, of those from first to last: `from` the first
 * of them, with the weights from start[sample] on.
 */
function resampling(begin, side, length, size = CROP_SIZE) {
  const first = Math.max(0, Math.floor(begin) - 1);
  const last = Math.min(length, Math.ceil(begin + side) + 1);
  const step = side / size;
  const from = new Int32Array(size);
  const start = new Int32Array(size + 1);
  const weights = new Float32Array(size * (Math.ceil(Math.max(step, 3)) + 2));
  for (let sample = 0, at = 0; sample < size; sample++) {
    const low = begin + step * sample;
    const middle = low + step / 2;
    const [reach, end] = step >= 1 ? [low, low + step] : [middle - 1.5, middle + 1.5];
    from[sample] = Math.min(Math.max(first, Math.floor(reach)), last);
    const to = Math.max(from[sample], Math.min(last, Math.ceil(end)));
    for (let pixel = from[sample]; pixel < to; pixel++, at++) {
      const overlap = Math.min(low + step, pixel + 1) - Math.max(low, pixel);
      const share = step >= 1 ? overlap / step : 1 - Math.abs(middle - (pixel + 0.5));
      weights[at] = Math.max(share, 0);
    }
    start[sample + 1] = at;
  }
  return { first, last, from, start, weights };
}
