/** The part of a given mask that matters: without specks, threads, and parts far from the largest; as anyprobe.masks.parts. */

import { CONTRACT } from "../core/contract.js";
import { grow, labelParts, shrink } from "./parts.js";

const NUMBERS = CONTRACT.mask.specks;

/**
 * @param {Float32Array} mask above one half somewhere
 * @returns {{mask: Float32Array, large: number, isOutline: boolean}} mask: the given one itself where nothing is dropped;
 *   large: how many large parts it had; isOutline: whether it is only the outline of something
 */
export function keepObject(mask, width) {
  const inside = Uint8Array.from(mask, (value) => (value > 0.5 ? 1 : 0));
  const area = countOf(inside);
  const radius = Math.max(1, Math.round(NUMBERS.thin * Math.sqrt(area)));
  let body = grow(shrink(inside, width, radius), width, 2 * radius).map((value, i) => value & inside[i]);
  if (2 * countOf(body) < area) body = inside; // a drawing of lines
  const { labels, sizes } = labelParts(body, width);
  const boxes = boxesOf(labels, sizes.length, width);
  const largest = sizes.indexOf(sizes.reduce((a, b) => Math.max(a, b)));
  const kept = new Set([largest]);
  let box = boxes[largest];
  let waiting = [...sizes.keys()].filter((one) => one && one !== largest && sizes[one] >= NUMBERS.share * sizes[largest]).sort((a, b) => sizes[b] - sizes[a]);
  const isNear = (one) => overhang(boxes[one], box) <= NUMBERS.reach * Math.sqrt(sizes[one]);
  for (let near = waiting.find(isNear); near; near = waiting.find(isNear)) {
    kept.add(near);
    waiting = waiting.filter((one) => one !== near);
    box = box.map((at, i) => (i < 2 ? Math.min : Math.max)(at, boxes[near][i]));
  }
  let belongs = Uint8Array.from(labels, (label) => (kept.has(label) ? 1 : 0));
  const threads = labelParts(inside.map((value, i) => value & ~body[i]), width);
  const ends = boxesOf(threads.labels, threads.sizes.length, width);
  const beside = grow(belongs, width);
  const touching = new Set(threads.labels.filter((label, i) => label && beside[i]));
  const reach = NUMBERS.thread_reach * Math.sqrt(sizes[largest]);
  belongs = belongs.map((value, i) => value || Number(touching.has(threads.labels[i]) && overhang(ends[threads.labels[i]], box) <= reach));
  const large = sizes.filter((size) => size >= NUMBERS.large * sizes[largest]).length;
  return { mask: without(mask, inside, belongs, width), large, isOutline: isOutline(belongs, width, radius) };
}

/** A mask without the pixels that do not belong, and their soft edge. */
function without(mask, inside, belongs, width) {
  const dropped = inside.map((value, i) => value & ~belongs[i]);
  if (!dropped.includes(1)) return mask;
  const [edge, near] = [dropped, belongs].map((part) => grow(part, width, NUMBERS.soft_px));
  return mask.map((value, i) => (dropped[i] || (edge[i] && !near[i]) ? 0 : value));
}

/** Whether the largest hole, the mask's gaps closed, is far larger than the mask. */
function isOutline(belongs, width, radius) {
  const room = 2 * radius + 1;
  const [wide, high] = [width + 2 * room, belongs.length / width + 2 * room];
  const placed = new Uint8Array(wide * high);
  for (let at = 0; at < belongs.length; at += width) placed.set(belongs.subarray(at, at + width), (at / width + room) * wide + room);
  const { labels, sizes } = labelParts(grow(placed, wide, 2 * radius).map((value) => 1 - value), wide);
  sizes[labels[0]] = 0;
  const area = countOf(belongs);
  return area < NUMBERS.outline * (area + sizes.reduce((a, b) => Math.max(a, b)));
}

/** Bounding box [x0, y0, x1, y1] (exclusive) of each label. */
function boxesOf(labels, count, width) {
  const boxes = Array.from({ length: count }, () => [Infinity, Infinity, 0, 0]);
  labels.forEach((label, i) => {
    if (!label) return;
    const [box, x, y] = [boxes[label], i % width, Math.floor(i / width)];
    if (x < box[0]) box[0] = x;
    if (y < box[1]) box[1] = y;
    if (x >= box[2]) box[2] = x + 1;
    if (y >= box[3]) box[3] = y + 1;
  });
  return boxes;
}

/** Most pixels by which a box extends beyond another. */
const overhang = (box, of) => Math.max(of[0] - box[0], of[1] - box[1], box[2] - of[2], box[3] - of[3], 0);

const countOf = (part) => part.reduce((sum, value) => sum + value, 0);
