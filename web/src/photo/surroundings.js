/** What a picture shows beside its object, as a part of the map, as anyprobe.estimate.surroundings. */

import { CONTRACT } from "../core/contract.js";
import { luminance } from "../core/color.js";
import { MAP_HEIGHT, pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { inverseResponse, response } from "../core/response.js";
import { CROP_SIZE, focalPx } from "./crop.js";

const GOES_ON = CONTRACT.surroundings.goes_on;
const PIXELS = 2 * MAP_HEIGHT * MAP_HEIGHT;

/** Samples of the crop around the object that are left out: its edge is not where the mask says. */
const GROW = CONTRACT.surroundings.grow_px;

/** Pixels of the shrunk picture on one of the map's. */
const FINE = CONTRACT.surroundings.fine;

/** Display value from which on a place is at least as bright as it looks. */
const CLIPPED = CONTRACT.surroundings.clipped;

/** The radiance that looks so. */
const WHITE = inverseResponse(CLIPPED);

/** Standard deviation of display values up to which what is behind the object is one colour: a cut-out, not a place. */
const PLAIN = CONTRACT.surroundings.plain;

/** How much of the colour by which what is seen differs from the prediction there is taken for the light's own. */
const TINT = CONTRACT.surroundings.tint;

/** Added to radiance before its logarithm is compared. */
const TINT_FLOOR = CONTRACT.surroundings.tint_floor;

/** Confidence of a place that is seen. */
const SEEN = CONTRACT.surroundings.seen;

/** What colours are divided by at least, where next to nothing is covered. */
const LEAST_COVER = 1e-3;

/** Shallowest -z of a direction that still meets the picture's plane. */
const AHEAD = 0.05;

/**
 * A picture whose transparent pixels are black, for their colours mean nothing, and one that is white where it is opaque.
 *
 * @param {import("./picture.js").Picture} picture
 * @returns {{picture: import("./picture.js").Picture, opaque: import("./picture.js").Picture | null}} opaque: null, and the
 *   picture itself, where all or nothing is transparent
 */
export function withoutTransparent(picture) {
  const { width, height, rgba } = picture;
  let clear = 0;
  for (let at = 3; at < rgba.length; at += 4) clear += rgba[at] < 128;
  if (clear === 0 || clear === width * height) return { picture, opaque: null };
  const [shown, white] = [rgba.slice(), new Uint8ClampedArray(rgba.length)];
  for (let at = 0; at < rgba.length; at += 4) (rgba[at + 3] < 128 ? shown : white).fill(rgba[at + 3] < 128 ? 0 : 255, at, at + 3);
  return { picture: { width, height, rgba: shown }, opaque: { width, height, rgba: white } };
}

/**
 * The map in the crop's frame as far as the picture shows it beside the object.
 *
 * @param {import("./picture.js").Picture} picture
 * @param {number} longFovDeg
 * @param {ReturnType<typeof import("./crop.js").cropObject>} crop
 * @param {import("./picture.js").Picture | null} [opaque] of withoutTransparent
 * @returns {Float32Array | null} [4, 64, 128] display RGB times cover, and cover; null where it shows one colour
 */
export function seeSurroundings(picture, longFovDeg, { cameraFromCrop, image, tanHalf }, opaque = null) {
  const { width, height } = picture;
  const focal = focalPx(width, height, longFovDeg);
  const scale = Math.min(1, (FINE * MAP_HEIGHT) / Math.PI / focal);
  const [small, smallOpaque] = [shrink(picture, scale), opaque && shrink(opaque, scale)];
  const object = grown(image.subarray(3 * CROP_SIZE * CROP_SIZE));
  const surroundings = new Float32Array(4 * PIXELS);
  const [a, b, c, d, e, f, g, h, i] = cameraFromCrop;
  const directions = pixelDirections(MAP_HEIGHT);
  const colors = new Float64Array(3);
  const sums = new Float64Array(6);
  let count = 0;
  for (let pixel = 0, at = 0; pixel < PIXELS; pixel++, at += 3) {
    const [x, y, z] = [directions[at], directions[at + 1], directions[at + 2]];
    const depth = -(g * x + h * y + i * z);
    if (depth <= AHEAD) continue;
    const column = 0.5 + (focal * (a * x + b * y + c * z)) / depth / width;
    const row = 0.5 - (focal * (d * x + e * y + f * z)) / depth / height;
    if (column <= 0 || column >= 1 || row <= 0 || row >= 1) continue;
    let cover = 1 - hidden(object, tanHalf, x, y, z);
    let share = 1; // of what is around the place that is opaque
    if (opaque) {
      sample(smallOpaque.values, 3, small.width, small.height, column, row, colors);
      share = colors[0];
      cover *= share;
    }
    if (cover <= 0) continue;
    sample(small.values, 3, small.width, small.height, column, row, colors);
    for (let channel = 0; channel < 3; channel++) {
      colors[channel] /= Math.max(share, LEAST_COVER);
      surroundings[channel * PIXELS + pixel] = colors[channel] * cover;
      sums[channel] += colors[channel];
      sums[3 + channel] += colors[channel] ** 2;
    }
    surroundings[3 * PIXELS + pixel] = cover;
    count++;
  }
  const variance = (channel) => sums[3 + channel] / count - (sums[channel] / count) ** 2;
  return count > 0 && Math.max(variance(0), variance(1), variance(2)) > PLAIN ** 2 ? surroundings : null;
}

/**
 * Display colours of the nearest seen place of every direction and the angle to it in degrees, four numbers a pixel,
 * between the middles of GOES_ON.rows rows; null where nothing is seen.
 *
 * @param {Float32Array} surroundings
 */
export function nearestSeen(surroundings) {
  const rows = GOES_ON.rows;
  const [columns, step] = [2 * rows, MAP_HEIGHT / rows];
  const directions = pixelDirections(rows);
  const [places, colors] = [3, 3].map((size) => new Float64Array(size * rows * columns)); // of what is seen
  let end = 0;
  for (let cell = 0; cell < rows * columns; cell++) {
    const sums = [0, 0, 0, 0];
    for (let k = 0; k < step * step; k++) {
      const row = step * Math.floor(cell / columns) + Math.floor(k / step);
      const pixel = row * 2 * MAP_HEIGHT + step * (cell % columns) + (k % step);
      for (let channel = 0; channel < 4; channel++) sums[channel] += surroundings[channel * PIXELS + pixel];
    }
    if (sums[3] < GOES_ON.least_cover * step * step) continue;
    for (let axis = 0; axis < 3; axis++, end++) {
      places[end] = directions[3 * cell + axis];
      colors[end] = Math.min(sums[axis] / sums[3], 1);
    }
  }
  if (end === 0) return null;
  const coarse = new Float32Array(4 * rows * columns);
  for (let cell = 0; cell < rows * columns; cell++) {
    const [x, y, z] = [directions[3 * cell], directions[3 * cell + 1], directions[3 * cell + 2]];
    let [best, most] = [0, -2];
    for (let i = 0; i < end; i += 3) {
      const cosine = x * places[i] + y * places[i + 1] + z * places[i + 2];
      if (cosine > most) [best, most] = [i, cosine];
    }
    for (let channel = 0; channel < 3; channel++) coarse[4 * cell + channel] = colors[best + channel];
    coarse[4 * cell + 3] = (Math.acos(Math.min(Math.max(most, -1), 1)) * 180) / Math.PI;
  }
  return enlarged(coarse, rows);
}

/** Four numbers a pixel of a map of so many rows, at MAP_HEIGHT rows: between the pixels' middles, across the seam. */
function enlarged(coarse, rows) {
  const [columns, step] = [2 * rows, MAP_HEIGHT / rows];
  const fine = new Float32Array(4 * PIXELS);
  for (let pixel = 0; pixel < PIXELS; pixel++) {
    const v = Math.min(Math.max((Math.floor(pixel / (2 * MAP_HEIGHT)) + 0.5) / step - 0.5, 0), rows - 1);
    const u = ((pixel % (2 * MAP_HEIGHT)) + 0.5) / step - 0.5;
    const [top, left] = [Math.floor(v), Math.floor(u)];
    for (let corner = 0; corner < 4; corner++) {
      const [down, right] = [corner >> 1, corner & 1];
      const share = (down ? v - top : 1 - v + top) * (right ? u - left : 1 - u + left);
      const from = 4 * (Math.min(top + down, rows - 1) * columns + ((left + right + columns) % columns));
      for (let k = 0; k < 4; k++) fine[4 * pixel + k] += share * coarse[from + k];
    }
  }
  return fine;
}

/** A predicted radiance drawn by a share to the nearest seen display value; what is above white stays. */
function continued(predicted, nearest, share) {
  const shown = Math.min(predicted, 1);
  const display = response(shown);
  return inverseResponse(display + share * (nearest - display)) + predicted - shown;
}

/**
 * A model's answer with what is known of the map in the place of its prediction, which takes on some of the colour that it
 * misses there.
 *
 * @param {object} stages of Models.light
 * @param {Float32Array} surroundings of seeSurroundings
 * @param {boolean} [tints] whether the prediction takes on that colour
 * @param {number} [sure] confidence of what is known
 * @param {{share: number, reach_deg: number}} [goesOn] how the prediction follows what is seen beside it
 */
export function useSurroundings(stages, surroundings, tints = true, sure = SEEN, goesOn = GOES_ON) {
  const tint = tints ? tintOf(stages.radiance, surroundings) : [1, 1, 1];
  const nearest = nearestSeen(surroundings);
  const radiance = new Float32Array(stages.radiance.length);
  const predicted = new Float64Array(3);
  const display = new Float64Array(3);
  const seen = new Float64Array(3);
  for (let pixel = 0, to = 0; pixel < PIXELS; pixel++, to += 3) {
    const cover = surroundings[3 * PIXELS + pixel];
    const share = nearest ? goesOn.share * Math.exp(-nearest[4 * pixel + 3] / goesOn.reach_deg) : 0;
    for (let channel = 0; channel < 3; channel++) {
      predicted[channel] = stages.radiance[to + channel] * tint[channel];
      if (nearest) predicted[channel] = continued(predicted[channel], nearest[4 * pixel + channel], share);
    }
    if (cover === 0) {
      radiance.set(predicted, to);
      continue;
    }
    for (let channel = 0; channel < 3; channel++) {
      display[channel] = surroundings[channel * PIXELS + pixel] / Math.max(cover, 1e-3);
      seen[channel] = inverseResponse(display[channel]);
    }
    const gain = clippedGain(display, seen, predicted);
    for (let channel = 0; channel < 3; channel++) {
      radiance[to + channel] = predicted[channel] + cover * (seen[channel] * gain - predicted[channel]);
    }
  }
  const confidence = stages.confidence?.map((value, i) => value + surroundings[3 * PIXELS + i] * (sure - value)) ?? null;
  if (!stages.lnRadiance) return { ...stages, radiance, confidence };
  const lnRadiance = radiance.map((value) => Math.log(Math.max(value, 1e-6)));
  return { ...stages, radiance, confidence, ldr: radiance.map((value) => response(value)), lnRadiance };
}

/**
 * What makes a clipped place as bright as the prediction, if that is brighter: one gain, so that no channel alone takes a
 * light source on; and none that would clip a channel which is not.
 */
function clippedGain(display, seen, predicted) {
  let room = Infinity;
  let clipped = false;
  for (let channel = 0; channel < 3; channel++) {
    if (display[channel] >= CLIPPED) clipped = true;
    else room = Math.min(room, WHITE / Math.max(seen[channel], 1e-6));
  }
  if (!clipped) return 1;
  return Math.min(Math.max(luminance(...predicted) / luminance(...seen), 1), Math.max(room, 1));
}

/** How much of the sphere is known. */
export function coverageOf(surroundings) {
  const angles = pixelSolidAngles(MAP_HEIGHT);
  let sum = 0;
  for (let pixel = 0; pixel < PIXELS; pixel++) {
    sum += surroundings[3 * PIXELS + pixel] * angles[Math.floor(pixel / (2 * MAP_HEIGHT))];
  }
  return sum / (4 * Math.PI);
}

/** Shares of geometric mean 1 that bring the prediction's colour nearer to that of what is seen. */
function tintOf(radiance, surroundings) {
  const missed = [0, 0, 0];
  let weights = 0;
  for (let pixel = 0; pixel < PIXELS; pixel++) {
    const cover = surroundings[3 * PIXELS + pixel];
    if (cover <= 0.5) continue;
    weights += cover;
    for (let channel = 0; channel < 3; channel++) {
      const seen = inverseResponse(surroundings[channel * PIXELS + pixel] / cover);
      const predicted = Math.min(radiance[3 * pixel + channel], 1);
      missed[channel] += cover * Math.log((seen + TINT_FLOOR) / (predicted + TINT_FLOOR));
    }
  }
  if (weights === 0) return [1, 1, 1];
  const mean = (missed[0] + missed[1] + missed[2]) / 3;
  return missed.map((sum) => Math.exp((TINT * (sum - mean)) / weights));
}

/** How much of a direction of the crop's frame the object hides. */
function hidden(object, tanHalf, x, y, z) {
  if (-z <= AHEAD) return 0;
  const column = 0.5 - (0.5 * x) / z / tanHalf;
  const row = 0.5 + (0.5 * y) / z / tanHalf;
  if (column <= 0 || column >= 1 || row <= 0 || row >= 1) return 0;
  return sample(object, 1, CROP_SIZE, CROP_SIZE, column, row, [0])[0];
}

/** Between the pixels of a picture at shares of its width and height. */
function sample(values, channels, width, height, column, row, out) {
  const x = Math.min(Math.max(column * width - 0.5, 0), width - 1);
  const y = Math.min(Math.max(row * height - 0.5, 0), height - 1);
  const [x0, y0] = [Math.floor(x), Math.floor(y)];
  const right = x0 + 1 < width ? channels : 0;
  const down = y0 + 1 < height ? width * channels : 0;
  const [fx, fy] = [x - x0, y - y0];
  let at = (y0 * width + x0) * channels;
  for (let channel = 0; channel < channels; channel++, at++) {
    const upper = values[at] * (1 - fx) + values[at + right] * fx;
    const lower = values[at + down] * (1 - fx) + values[at + down + right] * fx;
    out[channel] = upper * (1 - fy) + lower * fy;
  }
  return out;
}

/** A picture's display values in [0, 1] at a smaller scale, each the mean of the pixels that lie on it. */
function shrink({ width, height, rgba }, scale) {
  const small = { width: Math.max(1, Math.round(width * scale)), height: Math.max(1, Math.round(height * scale)) };
  const [columns, rows] = [bordersOf(width, small.width), bordersOf(height, small.height)];
  const values = new Float32Array(3 * small.width * small.height);
  for (let row = 0; row < small.height; row++) {
    for (let y = rows[row]; y < rows[row + 1]; y++) {
      let from = 4 * y * width;
      for (let column = 0, to = 3 * row * small.width; column < small.width; column++, to += 3) {
        let [r, g, b] = [0, 0, 0];
        for (const end = 4 * (y * width + columns[column + 1]); from < end; from += 4) {
          r += rgba[from];
          g += rgba[from + 1];
          b += rgba[from + 2];
        }
        const share = 1 / (255 * (columns[column + 1] - columns[column]) * (rows[row + 1] - rows[row]));
        values[to] += r * share;
        values[to + 1] += g * share;
        values[to + 2] += b * share;
      }
    }
  }
  return { ...small, values };
}

/** The first of `length` pixels on each of `count` larger ones, and the end; a middle on a border is the lower's. */
function bordersOf(length, count) {
  return Int32Array.from({ length: count + 1 }, (_, i) => Math.floor((i * length) / count + 0.5));
}

/** The object's mask in 8 bits, larger by GROW samples on every side. */
function grown(mask) {
  const wide = largestBeside(mask.map((value) => Math.round(255 * value) / 255), 1, CROP_SIZE);
  return largestBeside(wide, CROP_SIZE, 1);
}

/** The largest of the samples up to GROW steps away along one axis. */
function largestBeside(values, step, across) {
  const out = new Float32Array(values.length);
  for (let line = 0; line < CROP_SIZE; line++) {
    const begin = line * across;
    for (let sample = 0; sample < CROP_SIZE; sample++) {
      const last = Math.min(sample + GROW, CROP_SIZE - 1);
      let most = 0;
      for (let i = Math.max(sample - GROW, 0); i <= last; i++) most = Math.max(most, values[begin + i * step]);
      out[begin + sample * step] = most;
    }
  }
  return out;
}
