/** Whether a camera's picture still shows what it showed: means over blocks of pixels, which noise hardly moves. */

const BLOCK_PX = 16;

/** Of 255: noise of 5 moves a block's mean by 0.3; an edge of a fifth of the range that goes by a pixel, by 3. */
const MOVED = 3;

/**
 * @param {import("../photo/picture.js").Picture} picture
 * @returns {Float32Array} means of green, of the whole blocks
 */
export function blockMeans({ width, height, rgba }) {
  const across = Math.floor(width / BLOCK_PX);
  const down = Math.floor(height / BLOCK_PX);
  const means = new Float32Array(across * down);
  for (let y = 0; y < down * BLOCK_PX; y++) {
    const line = Math.floor(y / BLOCK_PX) * across;
    let at = 4 * y * width + 1;
    for (let block = 0; block < across; block++) {
      let sum = 0;
      for (const end = at + 4 * BLOCK_PX; at < end; at += 4) sum += rgba[at];
      means[line + block] += sum / BLOCK_PX ** 2;
    }
  }
  return means;
}

/** Whether any block is another than it was. */
export function hasMoved(means, before) {
  return means.length !== before.length || means.some((mean, i) => Math.abs(mean - before[i]) > MOVED);
}
