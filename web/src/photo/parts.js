/** Connected parts of a mask, as anyprobe.masks.parts. */

import { CONTRACT } from "../core/contract.js";

/** Holes up to this share of the object are filled; larger ones stay, as in a handle. */
const HOLE_SHARE = CONTRACT.mask.hole_share;

/**
 * Which 4-connected part each pixel belongs to.
 *
 * @param {Uint8Array} inside 1 inside
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

/** A part and its holes that are at most HOLE_SHARE of it. */
export function fillHoles(part, width) {
  const { labels, sizes } = labelParts(part.map((value) => 1 - value), width);
  const most = HOLE_SHARE * Math.max(part.reduce((sum, value) => sum + value), 1);
  const fills = sizes.map((hole) => hole <= most);
  fills[0] = false;
  for (let x = 0; x < width; x++) fills[labels[x]] = fills[labels[part.length - 1 - x]] = false;
  for (let at = 0; at < part.length; at += width) fills[labels[at]] = fills[labels[at + width - 1]] = false;
  return part.map((value, i) => (fills[labels[i]] ? 1 : value));
}

/** Dilate a mask by so many steps. */
export function grow(inside, width, steps = 1) {
  const grown = inside.slice();
  const edge = new Int32Array(inside.length); // first what is inside, then what each step has added
  let [begin, end] = [0, 0];
  for (let at = 0; at < inside.length; at++) if (inside[at]) edge[end++] = at;
  const add = (at) => {
    if (grown[at]) return;
    grown[at] = 1;
    edge[end++] = at;
  };
  for (let step = 0; step < steps; step++) {
    for (const last = end; begin < last; begin++) {
      const at = edge[begin];
      const x = at % width;
      if (x > 0) add(at - 1);
      if (x < width - 1) add(at + 1);
      if (at >= width) add(at - width);
      if (at + width < grown.length) add(at + width);
    }
  }
  return grown;
}

/** Erode a mask by so many steps, the border included. */
export function shrink(part, width, steps) {
  const [wide, high] = [width + 2, part.length / width + 2];
  const outside = new Uint8Array(wide * high).fill(1);
  for (let at = 0; at < part.length; at++) if (part[at]) outside[(Math.floor(at / width) + 1) * wide + (at % width) + 1] = 0;
  const left = grow(outside, wide, steps);
  return part.map((_, at) => 1 - left[(Math.floor(at / width) + 1) * wide + (at % width) + 1]);
}
