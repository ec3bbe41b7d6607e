/** The square crop around the object that the networks see, as anyprobe.infer.photo.crop_object. */

import { turnTowards } from "../core/frames.js";
import { objectBox } from "./picture.js";

/** Side of the window in samples: what the networks take. */
export const CROP_SIZE = 128;

/** Field of view [degrees] of the longer side where nothing else is known: a phone's main camera. */
export const DEFAULT_LONG_FOV_DEG = 65;

const MARGIN = 1.1;

/**
 * Cut a square around the object and bring it to CROP_SIZE x CROP_SIZE.
 *
 * Averaged over areas when shrinking, bilinear when enlarging, colour premultiplied by the mask.
 * What lies over the border of the picture is empty.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {Float32Array} mask
 * @param {number} longFovDeg field of view of the longer side
 * @returns {{image: Float32Array, cameraFromCrop: number[], sidePx: number, centerPx: number[],
 *   tanHalf: number}}
 *   image is [4, 128, 128] channel first, red, green, blue, mask in [0, 1]; cameraFromCrop turns
 *   the frame that looks at the window's centre along -Z to the camera's; tanHalf is the tangent of
 *   half the angle that the window's side takes in
 */
export function cropObject({ width, height, rgba }, mask, longFovDeg = DEFAULT_LONG_FOV_DEG) {
  const [x0, y0, x1, y1] = objectBox(mask, width);
  const centerPx = [(x0 + x1) / 2, (y0 + y1) / 2];
  const sidePx = MARGIN * Math.max(x1 - x0, y1 - y0);
  const columns = resampling(centerPx[0] - sidePx / 2, sidePx, width);
  const rows = resampling(centerPx[1] - sidePx / 2, sidePx, height);

  // first every row of the window to CROP_SIZE columns, then the columns to CROP_SIZE rows
  const count = rows.last - rows.first;
  const narrow = new Float32Array(4 * count * CROP_SIZE);
  for (let y = 0; y < count; y++) {
    for (let out = 0; out < CROP_SIZE; out++) {
      const { from, weights } = columns.samples[out];
      let [r, g, b, a] = [0, 0, 0, 0];
      for (let i = 0; i < weights.length; i++) {
        const pixel = (rows.first + y) * width + from + i;
        const share = weights[i] * mask[pixel];
        r += share * rgba[4 * pixel];
        g += share * rgba[4 * pixel + 1];
        b += share * rgba[4 * pixel + 2];
        a += share;
      }
      const to = 4 * (y * CROP_SIZE + out);
      narrow[to] = r / 255;
      narrow[to + 1] = g / 255;
      narrow[to + 2] = b / 255;
      narrow[to + 3] = a;
    }
  }
  const plane = CROP_SIZE * CROP_SIZE;
  const image = new Float32Array(4 * plane);
  for (let out = 0; out < CROP_SIZE; out++) {
    const { from, weights } = rows.samples[out];
    for (let x = 0; x < CROP_SIZE; x++) {
      for (let channel = 0; channel < 4; channel++) {
        let sum = 0;
        for (let i = 0; i < weights.length; i++) {
          sum += weights[i] * narrow[4 * ((from + i - rows.first) * CROP_SIZE + x) + channel];
        }
        image[channel * plane + out * CROP_SIZE + x] = Math.min(Math.max(sum, 0), 1);
      }
    }
  }
  const ray = pixelDirection(centerPx, width, height, longFovDeg);
  // away from the picture's centre a pixel takes in less: by cos^2 along the radius, by cos across it
  const tanHalf = (sidePx / 2 / focalPx(width, height, longFovDeg)) * Math.hypot(...ray) ** -1.5;
  return { image, cameraFromCrop: turnTowards(ray), sidePx, centerPx, tanHalf };
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

/** For every sample of the window [start, start + side): the first pixel it reads, and their weights. */
function resampling(start, side, length) {
  const first = Math.max(0, Math.floor(start) - 1);
  const last = Math.min(length, Math.ceil(start + side) + 1);
  const step = side / CROP_SIZE;
  const samples = Array.from({ length: CROP_SIZE }, (_, sample) => {
    const low = start + step * sample;
    const reach = step >= 1 ? [low, low + step] : [low + step / 2 - 1.5, low + step / 2 + 1.5];
    const from = Math.min(Math.max(first, Math.floor(reach[0])), last);
    const to = Math.max(from, Math.min(last, Math.ceil(reach[1])));
    const weights = Float32Array.from({ length: to - from }, (_, i) => {
      const pixel = from + i;
      if (step >= 1) return Math.max(Math.min(low + step, pixel + 1) - Math.max(low, pixel), 0) / step;
      return Math.max(1 - Math.abs(low + step / 2 - (pixel + 0.5)), 0);
    });
    return { from, weights };
  });
  return { first, last, samples };
}
