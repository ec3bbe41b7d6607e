/** Connected parts of a mask, as anyprobe.masks.regions. */

/** Holes up to this share of the object are filled; larger ones are seen through, as a handle is. */
const HOLE_SHARE = 0.03;

/**
 * Which 4-connected part each pixel belongs to.
 *
 * @param {Uint8Array} inside 1 inside
 * @param {number} width
 * @returns {{labels: Int32Array, sizes: number[]}} labels from 1, 0 outside; sizes by label in pixels, sizes[0] 0
 */
export function labelParts(inside, width) {
  const count = inside.length;
  const labels = new Int32Array(count);
  const sizes = [0];
  const waiting = new Int32Array(count);
  for (let start = 0; start < count; start++) {
    if (!inside[start] || labels[start]) continue;
    const label = sizes.length;
    let [size, last] = [0, 0];
    const visit = (at) => {
      if (at < 0 || at >= count || !inside[at] || labels[at]) return;
      labels[at] = label;
      waiting[last++] = at;
    };
    visit(start);
    while (last > 0) {
      const at = waiting[--last];
      const x = at % width;
      size += 1;
      if (x > 0) visit(at - 1);
      if (x < width - 1) visit(at + 1);
      visit(at - width);
      visit(at + width);
    }
    sizes.push(size);
  }
  return { labels, sizes };
}

/**
 * The part of mask > 0.5 that weighs most, with its small holes filled, and what share of all of it is not in it.
 *
 * @param {Float32Array} mask not empty
 * @param {number} width
 * @returns {{part: Float32Array, loose: number}}
 */
export function oneObject(mask, width) {
  const inside = Uint8Array.from(mask, (value) => (value > 0.5 ? 1 : 0));
  const { labels, sizes } = labelParts(inside, width);
  const weights = new Float64Array(sizes.length);
  labels.forEach((label, i) => (weights[label] += mask[i]));
  weights[0] = -Infinity;
  const label = weights.indexOf(Math.max(...weights));
  const part = Float32Array.from(labels, (one) => (one === label ? 1 : 0));
  const all = sizes.reduce((total, size) => total + size, 0);
  const loose = 1 - sizes[label] / all;
  fillHoles(part, width, sizes[label]);
  return { part, loose };
}

function fillHoles(part, width, size) {
  const { labels, sizes } = labelParts(Uint8Array.from(part, (value) => 1 - value), width);
  const fills = sizes.map((hole) => hole <= HOLE_SHARE * size);
  fills[0] = false;
  const count = part.length;
  for (let x = 0; x < width; x++) fills[labels[x]] = fills[labels[count - 1 - x]] = false;
  for (let at = 0; at < count; at += width) fills[labels[at]] = fills[labels[at + width - 1]] = false;
  labels.forEach((label, i) => {
    if (fills[label]) part[i] = 1;
  });
}
