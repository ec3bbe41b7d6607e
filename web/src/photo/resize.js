/** Pictures of any channels to another size, as anyprobe.core.resample: triangles as wide as a pixel of the coarser. */

/**
 * @param {Float32Array | Uint8ClampedArray} values height * width * channels, channel last
 * @param {number} channels how many a pixel has
 * @param {number[]} from width, height
 * @param {number[]} to width, height
 * @param {number[]} [box] x0, y0, x1, y1 of the part that is wanted, in pixels, fractions too
 * @returns {Float32Array}
 */
export function resize(values, channels, [width, height], [newWidth, newHeight], [x0, y0, x1, y1] = [0, 0, width, height]) {
  const line = newWidth * channels;
  const narrow = new Float32Array(height * line);
  const columns = weights(width, newWidth, x0, x1);
  for (let y = 0, to = 0; y < height; y++) {
    for (let x = 0; x < newWidth; x++) {
      const { first, shares } = columns[x];
      const from = (y * width + first) * channels;
      for (let c = 0; c < channels; c++, to++) {
        let sum = 0;
        for (let i = 0, at = from + c; i < shares.length; i++, at += channels) sum += shares[i] * values[at];
        narrow[to] = sum;
      }
    }
  }
  const out = new Float32Array(newHeight * line);
  weights(height, newHeight, y0, y1).forEach(({ first, shares }, y) => {
    const to = y * line;
    for (let i = 0; i < shares.length; i++) {
      const share = shares[i];
      const from = (first + i) * line;
      for (let at = 0; at < line; at++) out[to + at] += share * narrow[from + at];
    }
  });
  return out;
}

/** For every new sample the old ones it reads. */
function weights(length, count, begin, end) {
  const scale = (end - begin) / count;
  const reach = Math.max(scale, 1);
  return Array.from({ length: count }, (_, sample) => {
    const centre = begin + (sample + 0.5) * scale;
    const first = Math.max(0, Math.floor(centre - reach + 0.5));
    const last = Math.min(length, Math.floor(centre + reach + 0.5));
    const shares = [];
    for (let i = first; i < last; i++) shares.push(Math.max(1 - Math.abs(i + 0.5 - centre) / reach, 0));
    const sum = shares.reduce((total, share) => total + share, 0);
    return { first, shares: Float64Array.from(shares, (share) => share / sum) };
  });
}
