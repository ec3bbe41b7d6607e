/**
 * A mask from clicks alone, where no mask network is installed: the region of like colour around them.
 *
 * Colours grow smoothly over an object of uniform material and jump at its outline; shading may
 * darken it, so brightness counts less than hue.
 */

const LOCAL_STEP = 0.07;
const REACH = 0.45;
const LONG_PX = 320;

/**
 * @param {import("./picture.js").Picture} picture
 * @param {import("./picture.js").Hints} clicks in pixels of the picture; a box does not count
 * @returns {Float32Array} a mask of the picture; empty without a click on the object
 */
export function flood(picture, clicks) {
  const { width, height } = picture;
  const small = shrink(picture, Math.min(1, LONG_PX / Math.max(width, height)));
  const seeds = clicks.on.map((point) => colorAt(small, point));
  const against = clicks.off.map((point) => colorAt(small, point));
  const inside = new Uint8Array(small.width * small.height);
  clicks.on.forEach((point, i) => grow(small, point, seeds[i], against, inside));
  const mask = new Float32Array(width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      mask[y * width + x] = smoothAt(inside, small, x, y);
    }
  }
  return mask;
}

function shrink({ width, height, rgba }, scale) {
  const small = { width: Math.round(width * scale), height: Math.round(height * scale), scale };
  small.color = new Float32Array(3 * small.width * small.height);
  for (let y = 0; y < small.height; y++) {
    for (let x = 0; x < small.width; x++) {
      const from = 4 * (Math.floor((y + 0.5) / scale) * width + Math.floor((x + 0.5) / scale));
      const [r, g, b] = [rgba[from] / 255, rgba[from + 1] / 255, rgba[from + 2] / 255];
      const bright = (r + g + b) / 3;
      small.color.set([0.4 * bright, r - bright, g - bright], 3 * (y * small.width + x));
    }
  }
  return small;
}

function pixelAt({ width, height, scale }, [x, y]) {
  const column = Math.min(Math.max(Math.floor(x * scale), 0), width - 1);
  return Math.min(Math.max(Math.floor(y * scale), 0), height - 1) * width + column;
}

function colorAt(small, point) {
  const pixel = pixelAt(small, point);
  return small.color.subarray(3 * pixel, 3 * pixel + 3);
}

const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

function grow(small, point, seed, against, inside) {
  const { width, height, color } = small;
  const at = (pixel) => color.subarray(3 * pixel, 3 * pixel + 3);
  const waiting = [pixelAt(small, point)];
  inside[waiting[0]] = 1;
  while (waiting.length) {
    const pixel = waiting.pop();
    const x = pixel % width;
    const near = [x > 0 && pixel - 1, x < width - 1 && pixel + 1, pixel >= width && pixel - width];
    near.push(pixel < width * (height - 1) && pixel + width);
    for (const next of near) {
      if (next === false || inside[next]) continue;
      const c = at(next);
      const own = distance(c, seed);
      if (distance(c, at(pixel)) > LOCAL_STEP || own > REACH) continue;
      if (against.some((other) => distance(c, other) < own)) continue;
      inside[next] = 1;
      waiting.push(next);
    }
  }
}

/** Share of the 3 x 3 pixels around a point that are inside: fills pin holes, softens the edge. */
function smoothAt(inside, { width, height, scale }, x, y) {
  const column = Math.min(Math.floor((x + 0.5) * scale), width - 1);
  const row = Math.min(Math.floor((y + 0.5) * scale), height - 1);
  let sum = 0;
  for (let dy = -1; dy <= 1; dy++) {
    for (let dx = -1; dx <= 1; dx++) {
      const r = Math.min(Math.max(row + dy, 0), height - 1);
      const c = Math.min(Math.max(column + dx, 0), width - 1);
      sum += inside[r * width + c];
    }
  }
  return Math.min(Math.max((sum / 9 - 0.25) / 0.5, 0), 1);
}
