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
function kernelSpectrum(height, weight, normalised) {
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
    const scale = normalised ? 1 / sum : 1;
    spans[2 * out] = Math.floor(rows.findIndex((value) => value !== 0) / width);
    spans[2 * out + 1] = Math.floor(rows.findLastIndex((value) => value !== 0) / width) + 1;
    for (let inside = 0; inside < height; inside++) {
      const row = rows.subarray(inside * width, (inside + 1) * width);
      transform(row, imag.fill(0));
      for (let k = 0; k <= height; k++) matrices[(k * height + out) * height + inside] = row[k] * scale;
    }
  }
  return { matrices, spans };
}

const spectra = new Map();

function kept(key, make) {
  if (!spectra.has(key)) spectra.set(key, make());
  return spectra.get(key);
}

/** Apply a zonal kernel to a map of any number of channels, two of them at a time as one complex map. */
function apply(map, height, channels, spectrum) {
  const blurred = new Float32Array(map.length);
  for (let channel = 0; channel < channels; channel += 2) {
    applyToPair(map, blurred, height, channels, channel, channel + 1 < channels, spectrum);
  }
  return blurred;
}

function applyToPair(map, blurred, height, channels, channel, isPair, spectrum) {
  const width = 2 * height;
  const real = new Float64Array(width);
  const imag = new Float64Array(width);
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
  const product = multiply(spectrum, waves, height, isPair);
  for (let row = 0; row < height; row++) {
    for (let k = 0; k < width; k++) {
      // of real lines the upper half of the spectrum is the lower one's mirror image
      const isMirrored = !isPair && k > height;
      const at = (isMirrored ? width - k : k) * height + row;
      real[k] = product.real[at] / width;
      imag[k] = (isMirrored ? -product.imag[at] : product.imag[at]) / width;
    }
    transform(imag, real); // parts swapped: the inverse
    for (let j = 0, at = row * width * channels + channel; j < width; j++, at += channels) {
      blurred[at] = real[j];
      if (isPair) blurred[at + 1] = imag[j];
    }
  }
}

/** Every frequency's rows by that frequency's matrix; those above H only where `all`. */
function multiply({ matrices, spans }, { real: reals, imag: imags }, height, all) {
  const width = 2 * height;
  const product = { real: new Float64Array(width * height), imag: new Float64Array(width * height) };
  for (let k = 0; k < (all ? width : height + 1); k++) {
    const matrix = (k > height ? width - k : k) * height * height;
    const rows = k * height;
    for (let out = 0; out < height; out++) {
      const line = matrix + out * height;
      const end = spans[2 * out + 1];
      let real = 0;
      let imag = 0;
      for (let inside = spans[2 * out]; inside < end; inside++) {
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

/** Average over the cap of a radius [radians] around each direction. */
export function blurCap(map, height, channels, radius) {
  const spectrum = kept(`cap ${height} ${radius}`, () =>
    kernelSpectrum(height, (cosine) => (Math.acos(cosine) <= radius ? 1 : 0), true),
  );
  return apply(map, height, channels, spectrum);
}

/** Average with weight max(0, cos)^sharpness around each direction (paper Eq. 6); 1 gives irradiance / pi. */
export function blurCosinePower(map, height, channels, sharpness) {
  const spectrum = kept(`cosine ${height} ${sharpness}`, () =>
    kernelSpectrum(height, (cosine) => Math.max(cosine, 0) ** sharpness, true),
  );
  return apply(map, height, channels, spectrum);
}

/** Average with the weight of a GGX lobe of width alpha seen along the normal, n.wi D; alpha 1 is a cosine. */
export function blurGgx(map, height, channels, alpha) {
  const spectrum = kept(`ggx ${height} ${alpha}`, () =>
    kernelSpectrum(
      height,
      (cosine) => Math.max(cosine, 0) / (1 + alpha ** 2 + (alpha ** 2 - 1) * cosine) ** 2,
      true,
    ),
  );
  return apply(map, height, channels, spectrum);
}

/** Irradiance E(n) = integral of L max(0, n.wi) dwi, for n at every pixel centre. */
export function irradianceMap(map, height) {
  const spectrum = kept(`irradiance ${height}`, () =>
    kernelSpectrum(height, (cosine) => Math.max(cosine, 0), false),
  );
  return apply(map, height, 3, spectrum);
}
