/**
 * Blurs that depend on the angle alone (zonal kernels), exact on the map's pixels.
 *
 * On a latitude-longitude grid such a kernel couples two rows through their longitude
 * difference only, so a Fourier transform along the columns leaves one small matrix a frequency.
 */

import { pixelSolidAngles } from "../core/latlong.js";

const waves = new Map();

/** cos and sin of 2 pi k j / W for every frequency k up to W / 2. */
function wave(width) {
  if (!waves.has(width)) {
    const count = width / 2 + 1;
    const cos = new Float64Array(count * width);
    const sin = new Float64Array(count * width);
    for (let k = 0; k < count; k++) {
      for (let j = 0; j < width; j++) {
        const angle = (2 * Math.PI * ((k * j) % width)) / width;
        cos[k * width + j] = Math.cos(angle);
        sin[k * width + j] = Math.sin(angle);
      }
    }
    waves.set(width, { count, cos, sin });
  }
  return waves.get(width);
}

/** Cosine spectrum of weight(cos angle) dw: count matrices of H x H, rows out x rows in. */
function kernelSpectrum(height, weight, normalised) {
  const width = 2 * height;
  const { count, cos } = wave(width);
  const solidAngles = pixelSolidAngles(height);
  const spectrum = new Float64Array(count * height * height);
  const row = new Float64Array(height * width);
  for (let out = 0; out < height; out++) {
    const a = ((out + 0.5) * Math.PI) / height;
    let sum = 0;
    for (let inside = 0; inside < height; inside++) {
      const b = ((inside + 0.5) * Math.PI) / height;
      for (let j = 0; j < width; j++) {
        const cosine = Math.cos(a) * Math.cos(b) + Math.sin(a) * Math.sin(b) * Math.cos((j * Math.PI) / height);
        const value = weight(Math.min(Math.max(cosine, -1), 1)) * solidAngles[inside];
        row[inside * width + j] = value;
        sum += value;
      }
    }
    const scale = normalised ? 1 / sum : 1;
    for (let k = 0; k < count; k++) {
      for (let inside = 0; inside < height; inside++) {
        let value = 0;
        for (let j = 0; j < width; j++) value += row[inside * width + j] * cos[k * width + j];
        spectrum[(k * height + out) * height + inside] = value * scale;
      }
    }
  }
  return spectrum;
}

const spectra = new Map();

function kept(key, make) {
  if (!spectra.has(key)) spectra.set(key, make());
  return spectra.get(key);
}

/** Apply a zonal kernel to a map of any number of channels. */
function apply(map, height, channels, spectrum) {
  const width = 2 * height;
  const { count, cos, sin } = wave(width);
  const blurred = new Float32Array(map.length);
  const real = new Float64Array(count * height);
  const imag = new Float64Array(count * height);
  for (let channel = 0; channel < channels; channel++) {
    for (let row = 0; row < height; row++) {
      for (let k = 0; k < count; k++) {
        let re = 0;
        let im = 0;
        for (let j = 0; j < width; j++) {
          const value = map[(row * width + j) * channels + channel];
          re += value * cos[k * width + j];
          im += value * sin[k * width + j];
        }
        real[k * height + row] = re;
        imag[k * height + row] = im;
      }
    }
    for (let row = 0; row < height; row++) {
      const line = new Float64Array(width);
      for (let k = 0; k < count; k++) {
        let re = 0;
        let im = 0;
        const matrix = (k * height + row) * height;
        for (let inside = 0; inside < height; inside++) {
          re += spectrum[matrix + inside] * real[k * height + inside];
          im += spectrum[matrix + inside] * imag[k * height + inside];
        }
        const twice = (k === 0 || k === count - 1 ? 1 : 2) / width;
        for (let j = 0; j < width; j++) {
          line[j] += twice * (re * cos[k * width + j] + im * sin[k * width + j]);
        }
      }
      for (let j = 0; j < width; j++) blurred[(row * width + j) * channels + channel] = line[j];
    }
  }
  return blurred;
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
