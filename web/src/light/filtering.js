/**
 * Blurs that depend on the angle alone (zonal kernels), exact on the map's pixels.
 *
 * On a latitude-longitude grid such a kernel couples two rows through their longitude
 * difference only, so a Fourier transform along the columns leaves one small matrix a frequency.
 */

import { pixelSolidAngles } from "../core/latlong.js";
import { transform } from "./fourier.js";

/**
 * Spectrum of weight(cos angle) dw, real as the weight is even.
 *
 * @returns {{matrices: Float64Array, spans: Int32Array}} H + 1 matrices of H x H, rows out x rows in, and for every row
 *   out the first and the end of the rows in that it is made of
 */
function kernelSpectrum(height, weight) {
  const width = 2 * height;
  const solidAngles = pixelSolidAngles(height);
  const matrices = new Float64Array((height + 1) * height * height);
  const spans = new Int32Array(2 * height);
  const rows = new Float64Array(height * width);
  const imag = new Float64Array(width);
  for (let out = 0; out < height; out++) {
    const a = ((out + 0.5) * Math.PI) / height;
    let sum = 0;
    for (let inside = 0; inside < height; inside++) {
      const b = ((inside + 0.5) * Math.PI) / height;
      for (let j = 0; j < width; j++) {
        const cosine = Math.cos(a) * Math.cos(b) + Math.sin(a) * Math.sin(b) * Math.cos((j * Math.PI) / height);
        const value = weight(Math.min(Math.max(cosine, -1), 1)) * solidAngles[inside];
        rows[inside * width + j] = value;
        sum += value;
      }
    }
    spans[2 * out] = Math.floor(rows.findIndex((value) => value !== 0) / width);
    spans[2 * out + 1] = Math.floor(rows.findLastIndex((value) => value !== 0) / width) + 1;
    for (let inside = 0; inside < height; inside++) {
      const row = rows.subarray(inside * width, (inside + 1) * width);
      transform(row, imag.fill(0));
      for (let k = 0; k <= height; k++) matrices[(k * height + out) * height + inside] = row[k] / sum;
    }
  }
  return { matrices, spans };
}

/** Apply a zonal kernel to a map of any number of channels, two of them at a time as one complex map. */
function apply(map, height, channels, spectrum) {
  const blurred = new Float32Array(map.length);
  for (let channel = 0; channel < channels; channel += 2) applyToPair(map, blurred, height, channels, channel, spectrum);
  return blurred;
}

function applyToPair(map, blurred, height, channels, channel, spectrum) {
  const width = 2 * height;
  const isPair = channel + 1 < channels;
  const [real, imag] = [new Float64Array(width), new Float64Array(width)];
  const waves = { real: new Float64Array(width * height), imag: new Float64Array(width * height) }; // frequency by frequency
  for (let row = 0; row < height; row++) {
    for (let j = 0, at = row * width * channels + channel; j < width; j++, at += channels) {
      real[j] = map[at];
      imag[j] = isPair ? map[at + 1] : 0;
    }
    transform(real, imag);
    for (let k = 0, to = row; k < width; k++, to += height) {
      waves.real[to] = real[k];
      waves.imag[to] = imag[k];
    }
  }
  const product = multiply(spectrum, waves, height);
  for (let row = 0; row < height; row++) {
    for (let k = 0, at = row; k < width; k++, at += height) {
      real[k] = product.real[at] / width;
      imag[k] = product.imag[at] / width;
    }
    transform(imag, real); // parts swapped: the inverse
    for (let j = 0, at = row * width * channels + channel; j < width; j++, at += channels) {
      blurred[at] = real[j];
      if (isPair) blurred[at + 1] = imag[j];
    }
  }
}

/** Every frequency's rows by that frequency's matrix; those above H have the matrices of those below it. */
function multiply({ matrices, spans }, { real: reals, imag: imags }, height) {
  const width = 2 * height;
  const product = { real: new Float64Array(width * height), imag: new Float64Array(width * height) };
  for (let k = 0; k < width; k++) {
    const matrix = (k > height ? width - k : k) * height * height;
    const rows = k * height;
    for (let out = 0; out < height; out++) {
      const line = matrix + out * height;
      let [real, imag] = [0, 0];
      for (let inside = spans[2 * out], end = spans[2 * out + 1]; inside < end; inside++) {
        const weight = matrices[line + inside];
        real += weight * reals[rows + inside];
        imag += weight * imags[rows + inside];
      }
      product.real[rows + out] = real;
      product.imag[rows + out] = imag;
    }
  }
  return product;
}

const spectra = new Map();

/** Averages by a weight of the cosine; its spectrum is kept for the next call. */
const blurBy = (name, weightOf) => (map, height, channels, width) => {
  const key = `${name} ${height} ${width}`;
  if (!spectra.has(key)) spectra.set(key, kernelSpectrum(height, weightOf(width)));
  return apply(map, height, channels, spectra.get(key));
};

/** Average over the cap of a radius [radians] around each direction. */
export const blurCap = blurBy("cap", (radius) => (cosine) => (Math.acos(cosine) <= radius ? 1 : 0));

/** Average with weight max(0, cos)^sharpness around each direction (paper Eq. 6); 1 gives irradiance / pi. */
export const blurCosinePower = blurBy("cosine", (sharpness) => (cosine) => Math.max(cosine, 0) ** sharpness);

/** Average with the weight of a GGX lobe of width alpha seen along the normal, n.wi D; alpha 1 is a cosine. */
export const blurGgx = blurBy("ggx", (alpha) => (cosine) => Math.max(cosine, 0) / (1 + alpha ** 2 + (alpha ** 2 - 1) * cosine) ** 2);
