/** Discrete Fourier transforms of complex lines whose length is a power of two, in place. */

const plans = new Map();

/** Roots of unity, and the order in which samples are read. */
function planOf(length) {
  if (!plans.has(length)) {
    const angle = (_, i) => (2 * Math.PI * i) / length;
    const cos = Float64Array.from({ length: length / 2 }, angle).map(Math.cos);
    const sin = Float64Array.from({ length: length / 2 }, angle).map(Math.sin);
    const swapped = new Int32Array(length);
    for (let i = 1; i < length; i++) swapped[i] = (swapped[i >> 1] >> 1) | (i & 1 ? length >> 1 : 0);
    plans.set(length, { cos, sin, swapped });
  }
  return plans.get(length);
}

/**
 * X_k = sum of x_j exp(-2 pi i k j / N), not divided by N; swap real and imag for its inverse times N.
 *
 * @param {Float64Array} real N numbers
 * @param {Float64Array} imag
 */
export function transform(real, imag) {
  const length = real.length;
  const { cos, sin, swapped } = planOf(length);
  for (let i = 0; i < length; i++) {
    const j = swapped[i];
    if (j <= i) continue;
    const [re, im] = [real[i], imag[i]];
    real[i] = real[j];
    imag[i] = imag[j];
    real[j] = re;
    imag[j] = im;
  }
  for (let half = 1; half < length; half *= 2) {
    const stride = length / (2 * half);
    for (let start = 0; start < length; start += 2 * half) {
      for (let k = 0; k < half; k++) {
        const c = cos[k * stride];
        const s = sin[k * stride];
        const upper = start + k;
        const lower = upper + half;
        const re = c * real[lower] + s * imag[lower];
        const im = c * imag[lower] - s * real[lower];
        real[lower] = real[upper] - re;
        imag[lower] = imag[upper] - im;
        real[upper] += re;
        imag[upper] += im;
      }
    }
  }
}
