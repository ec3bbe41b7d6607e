/**
 * Which object of a picture is meant, as anyprobe.masks.search: looks of a network at windows of it, and the part that the
 * prompts choose.
 *
 * @typedef {number[]} Window x0, y0, x1, y1 in whole pixels
 *
 * @typedef {object} Finding an object in a window
 * @property {Window} window
 * @property {Float32Array} cover GRID * GRID in [0, 1], without other parts
 * @property {Uint8Array} part of it that it is, 1 inside
 * @property {number} flat share of its outline across which the picture hardly changes
 * @property {number} cut length of its outline that a box cuts off from more of it, over the perimeter of its box
 */

import { CONTRACT } from "../core/contract.js";
import { fillHoles, grow, labelParts } from "./parts.js";
import { objectBox } from "./picture.js";
import { resize } from "./resize.js";

const { inside: INSIDE, search: NUMBERS, u2netp: { size: GRID }, given: { few_px: FEW_CELLS } } = CONTRACT.mask;
const { margin: MARGIN, edge_cells: EDGE_CELLS, split: SPLIT } = NUMBERS;
const CELLS = GRID * GRID;

/** A network's looks at windows of one picture, each computed once. */
export class Looks {
  #kept;

  /**
   * @param {import("./maskNetworks.js").U2NetP | import("./maskNetworks.js").SmallNetwork} network
   * @param {Map<string, Float32Array>} [kept] looks that were taken at it before
   */
  constructor(network, picture, kept = new Map()) {
    Object.assign(this, { network, picture, photo: [0, 0, picture.width, picture.height] });
    this.#kept = kept;
  }

  /** Cover of a window, zero outside the box. */
  async at(window, hints, isMirrored = false) {
    const cover = await this.uncut(window, hints, isMirrored);
    if (!hints.box) return cover;
    const isIn = insideOf(window, hints.box);
    return cover.map((value, i) => value * isIn[i]);
  }

  /** Cover of a window, outside the box too. */
  async uncut(window, hints, isMirrored = false) {
    const key = JSON.stringify([window, isMirrored, this.network.takesPrompts ? [hints.on, hints.off, hints.box] : null]);
    if (!this.#kept.has(key)) this.#kept.set(key, await look(this.network, this.picture, window, hints, isMirrored));
    return this.#kept.get(key);
  }

  /** Windows that were looked at, and whether mirrored, the nearest first; none of a network that looks otherwise for other prompts. */
  known() {
    const size = ([x0, y0, x1, y1]) => (x1 - x0) * (y1 - y0);
    const taken = this.network.takesPrompts ? [] : [...this.#kept.keys()].map((key) => JSON.parse(key));
    return taken.sort(([one], [other]) => size(one) - size(other));
  }
}

/** @param {Looks} looks @param {import("./picture.js").Hints} hints @returns {Promise<Finding | null>} null where nothing is there */
export async function findObject(looks, hints) {
  const known = looks.known();
  const start = hints.box ? around(looks.photo, hints.box, MARGIN) : looks.photo;
  const cover = await looks.at(start, hints);
  let found = choose(start, cover, hints);
  if (found && hints.box) found.cut = cutOff(found, await looks.uncut(start, hints), hints.box);
  if (!found && hints.on.length) found = await aroundClicks(looks, hints, known);
  if (!found && hints.off.length) found = cut(looks.picture, start, cover, hints);
  return found && lookCloser(looks, found, hints, known);
}

/** One look at the last frame's box and a margin. */
export async function lookAgain(looks, hints) {
  const window = around(looks.photo, hints.box, MARGIN);
  return choose(window, await looks.at(window, hints), hints);
}

/** Length of a part's outline at which its window's cover goes on beyond the box, over the perimeter of its own. */
function cutOff({ window, part }, cover, box) {
  const isIn = insideOf(window, box);
  const [x0, y0, x1, y1] = objectBox(part, GRID);
  const count = grow(part, GRID).reduce((sum, value, i) => sum + (value && !isIn[i] && cover[i] > INSIDE ? 1 : 0), 0);
  return count / (2 * (x1 - x0 + y1 - y0));
}

/** A finding as a mask of the whole picture, with the soft edge that the network gives. */
export function maskOf({ window: [x0, y0, x1, y1], cover, part }, width, height) {
  const near = grow(part, GRID, EDGE_CELLS);
  const soft = cover.map((value, i) => (part[i] ? Math.max(value, 0.51) : near[i] ? Math.min(value, 0.49) : 0));
  const placed = resize(soft, 1, [GRID, GRID], [x1 - x0, y1 - y0]);
  const mask = new Float32Array(width * height);
  for (let y = y0; y < y1; y++) {
    const from = (y - y0) * (x1 - x0);
    mask.set(placed.subarray(from, from + x1 - x0), y * width + x0);
  }
  return mask;
}

/** IoU to expect of a finding if the cover of each cell is a probability: of the part and what is beside it. */
export function expectedOf({ cover, part }) {
  const near = grow(part, GRID, 2 * EDGE_CELLS);
  const sum = (weight) => cover.reduce((total, value, i) => total + weight(value, i), 0);
  const [inside, count] = [sum((value, i) => part[i] * value), sum((_, i) => part[i])];
  return inside / Math.max(count + sum((value, i) => (part[i] ? 0 : near[i] * value)), 1e-6);
}

/** Whether a part touches a side of its window that is not the photo's. */
function isCut({ window, part }, photo) {
  const cells = objectBox(part, GRID);
  return window.some((side, i) => side !== photo[i] && cells[i] === (i < 2 ? 0 : GRID));
}

/** One look of a network at a window. */
async function look(network, picture, window, hints, isMirrored) {
  const [x0, y0, x1] = window;
  const seen = cropOf(picture, window, isMirrored);
  if (rangeOf(seen.rgba) < 255 * NUMBERS.blank) return new Float32Array(CELLS);
  const place = ([x, y]) => [isMirrored ? x1 - x : x - x0, y - y0];
  const corners = hints.box && [...place(hints.box.slice(0, 2)), ...place(hints.box.slice(2))];
  const box = corners && [Math.min(corners[0], corners[2]), corners[1], Math.max(corners[0], corners[2]), corners[3]];
  const answer = await network.cover(seen, { on: hints.on.map(place), off: hints.off.map(place), box });
  const values = isMirrored ? mirrored(answer.values, answer.width) : answer.values;
  return resize(values, 1, [answer.width, answer.height], [GRID, GRID]);
}

/**
 * The parts under the clicks, or without any the one that weighs most; null where there is none, or where it holds a click
 * beside the object and no other part can be meant.
 */
export function choose(window, cover, { on, off }) {
  const { labels, sizes } = labelParts(insideParts(cover), GRID);
  const weights = new Float64Array(sizes.length);
  for (let i = 0; i < CELLS; i++) weights[labels[i]] += cover[i];
  weights[0] = 0;
  const under = (points) => new Set(cellsOf(window, points).map(([x, y]) => labels[y * GRID + x]).filter((label) => label > 0));
  const [wanted, taken] = [under(on), under(off)];
  let chosen = new Set();
  if (on.length) {
    if (![...wanted].some((label) => taken.has(label))) chosen = wanted;
  } else {
    const left = weights.map((weight, label) => (taken.has(label) ? 0 : weight));
    const most = left.indexOf(Math.max(...left));
    const largest = Math.max(0, ...[...taken].map((label) => weights[label]));
    if (left[most] > NUMBERS.part_share * largest) chosen.add(most);
  }
  if (!chosen.size) return null;
  const part = fillHoles(new Uint8Array(CELLS).map((_, i) => (chosen.has(labels[i]) ? 1 : 0)), GRID);
  return { window, cover: cover.map((value, i) => (labels[i] && !part[i] ? 0 : value)), part, cut: 0, flat: 0 };
}

/** The mean of a finding and a mirrored look at its window alone, or a known one that shows it well. */
async function lookCloser(looks, found, hints, known) {
  const box = boxOf(found.window, found.part);
  const closer = hints.box || hints.on.length ? hints : { ...hints, box };
  const near = known.filter(([window]) => holds(found.window, window) && shows(window, box));
  let [window, again] = [found.window, found.cover];
  for (const [nearer, isMirrored] of [...near, [around(found.window, box, MARGIN), true]]) {
    again = await looks.at(nearer, closer, isMirrored);
    if (choose((window = nearer), again, hints)) break;
  }
  const cells = cellBox(window, found.window);
  const before = resize(found.cover, 1, [GRID, GRID], [GRID, GRID], cells);
  const kept = resize(Float32Array.from(found.part), 1, [GRID, GRID], [GRID, GRID], cells);
  const first = { ...found, window, cover: before, part: insideParts(kept) };
  const last = choose(window, before.map((value, i) => (value + again[i]) / 2), hints) ?? first;
  return { ...last, cut: found.cut, flat: flatShare(looks.picture, last) };
}

/** Share of a part's outline, by cells to either side of it, across which the picture hardly changes. */
function flatShare(picture, { window, part }) {
  const [change, apart, changes] = [changesOf(picture, window, GRID), 2 * EDGE_CELLS, []];
  for (let i = 0; i < CELLS; i++) {
    const right = (i % GRID) + apart < GRID ? i + apart : i;
    for (const other of [right, i + apart * GRID]) if (part[i] === 1 - part[other]) changes.push(change(i, other));
  }
  return changes.filter((one) => one < NUMBERS.alike).length / Math.max(changes.length, 1);
}

/** What says how far the colours of two cells of a window are apart, of grid * grid. */
function changesOf(picture, window, grid) {
  const { width, height, rgba } = cropOf(picture, window, false);
  const colors = resize(rgba, 4, [width, height], [grid, grid]);
  return (a, b) => Math.hypot(...[0, 1, 2].map((c) => (colors[4 * a + c] - colors[4 * b + c]) / 255));
}

/** What stands out in a known window that holds the clicks and does not cut it, else in one around them. */
async function aroundClicks(looks, hints, known) {
  const { photo } = looks;
  const squares = NUMBERS.windows.map((share) => [squareAround(photo, hints.on, share * Math.max(photo[2], photo[3])), false]);
  for (const look of [...known.filter(([window]) => cellsOf(window, hints.on).length === hints.on.length), ...squares]) {
    const found = choose(look[0], await looks.at(look[0], hints, look[1]), hints);
    if (found && !(known.includes(look) && isCut(found, photo))) return found;
  }
  return null;
}

/**
 * The part that holds clicks beside the object, without what is nearer to them than to the clicks on it: along the
 * picture's colours. Without a click on it, the cell of the part that is farthest from them is on it.
 */
function cut(picture, window, cover, hints) {
  const plain = choose(window, cover, { ...hints, off: [] });
  if (!plain) return null;
  const grid = GRID / 2;
  const change = changesOf(picture, window, grid);
  const part = resize(Float32Array.from(plain.part), 1, [GRID, GRID], [grid, grid]).map((value) => (value > INSIDE ? 1 : 0));
  const coarse = (points) => cellsOf(window, points).map((cell) => cell.map((at) => Math.floor((at * grid) / GRID)));
  let [on, off] = [coarse(hints.on), coarse(hints.off)];
  if (!on.length) {
    const away = Array.from(part, (_, i) => Math.min(...off.map(([x, y]) => Math.hypot((i % grid) - x, Math.floor(i / grid) - y))));
    const farthest = away.reduce((best, value, i) => (part[i] > part[best] || (part[i] && value > away[best]) ? i : best), 0);
    on = [[farthest % grid, Math.floor(farthest / grid)]];
  }
  const [mine, others] = [distance(change, part, on), distance(change, part, off)];
  const nearer = resize(mine.map((length, i) => (length < others[i] ? 1 : 0)), 1, [grid, grid], [GRID, GRID]);
  const kept = plain.part.map((value, i) => (value && nearer[i] > INSIDE ? 1 : 0));
  if (!kept.includes(1)) return null;
  return { ...plain, part: kept, cover: plain.cover.map((value, i) => (plain.part[i] && !kept[i] ? 0 : value)) };
}

/** Shortest way from the seeds within a part, counting steps and changes of colour; infinite beside it. */
function distance(change, part, seeds) {
  const [grid, { step, click_cells: reach }] = [GRID / 2, SPLIT];
  const isNear = (i) => seeds.some(([x, y]) => Math.max(Math.abs((i % grid) - x), Math.abs(Math.floor(i / grid) - y)) < reach);
  const length = Float64Array.from(part, (value, i) => (value && isNear(i) ? 0 : Infinity));
  const across = Float64Array.from(length, (_, i) => (i % grid ? step + change(i, i - 1) : Infinity));
  const down = Float64Array.from(length, (_, i) => (i >= grid ? step + change(i, i - grid) : Infinity));
  let isMoving = true;
  const pass = (i, from, cost) => {
    if (!part[i] || !(length[from] + cost < length[i])) return;
    length[i] = length[from] + cost;
    isMoving = true;
  };
  while (isMoving) {
    isMoving = false;
    for (let i = 1; i < length.length; i++) {
      pass(i, i - 1, across[i]);
      if (i >= grid) pass(i, i - grid, down[i]);
    }
    for (let i = length.length - 2; i >= 0; i--) {
      pass(i, i + 1, across[i + 1]);
      if (i + grid < length.length) pass(i, i + grid, down[i + grid]);
    }
  }
  return length;
}

/** Whether a box is in a window. */
const holds = (window, box) => window.every((side, i) => (i < 2 ? side <= box[i] : box[i] <= side));

/** Whether a look at a window shows what is in a box, across as many cells as an estimate wants of pixels. */
const shows = (window, box) => holds(window, box) && [0, 1].some((i) => (GRID * (box[i + 2] - box[i])) / (window[i + 2] - window[i]) >= FEW_CELLS);

/** A box and a margin in its longer sides, as far as they are in a window. */
export function around(window, box, margin) {
  const more = margin * Math.max(box[2] - box[0], box[3] - box[1]);
  return window.map((side, i) => (i < 2 ? Math.max(side, Math.floor(box[i] - more)) : Math.min(side, Math.ceil(box[i] + more))));
}

/** A square of that side around the middle of points, moved into a photo. */
function squareAround(photo, points, side) {
  const [[x0, x1], [y0, y1]] = [0, 1].map((axis) => {
    const [low, high] = [photo[axis], photo[axis + 2]];
    const middle = points.reduce((sum, point) => sum + point[axis], 0) / points.length;
    const extent = Math.min(high - low, Math.max(1, Math.round(side)));
    const start = Math.min(Math.max(Math.floor(middle - extent / 2), low), high - extent);
    return [start, start + extent];
  });
  return [x0, y0, x1, y1];
}

/** Column and row of the points that are in a window. */
function cellsOf([x0, y0, x1, y1], points) {
  return points
    .map(([x, y]) => [Math.floor(((x - x0) * GRID) / (x1 - x0)), Math.floor(((y - y0) * GRID) / (y1 - y0))])
    .filter(([x, y]) => x >= 0 && x < GRID && y >= 0 && y < GRID);
}

/** A window in the cells of one that holds it. */
function cellBox([x0, y0, x1, y1], [left, top, right, bottom]) {
  const [across, down] = [GRID / (right - left), GRID / (bottom - top)];
  return [(x0 - left) * across, (y0 - top) * down, (x1 - left) * across, (y1 - top) * down];
}

/** Box of a part in pixels of the picture. */
export function boxOf([x0, y0, x1, y1], part) {
  const [across, down] = [(x1 - x0) / GRID, (y1 - y0) / GRID];
  const [left, top, right, bottom] = objectBox(part, GRID);
  return [x0 + left * across, y0 + top * down, x0 + right * across, y0 + bottom * down];
}

/** Which cells of a window have their centres in a box. */
function insideOf([x0, y0, x1, y1], box) {
  const centre = (i, low, high) => low + ((i + 0.5) * (high - low)) / GRID;
  const isIn = (low, high, first, end) => new Uint8Array(GRID).map((_, i) => (centre(i, low, high) >= first && centre(i, low, high) < end ? 1 : 0));
  const [columns, rows] = [isIn(x0, x1, box[0], box[2]), isIn(y0, y1, box[1], box[3])];
  return new Uint8Array(CELLS).map((_, i) => columns[i % GRID] * rows[Math.floor(i / GRID)]);
}

/** 1 where a cover is more likely the object's than not. */
const insideParts = (cover) => new Uint8Array(CELLS).map((_, i) => (cover[i] > INSIDE ? 1 : 0));

/** A window of a picture as one of its own. */
function cropOf({ width, rgba }, [x0, y0, x1, y1], isMirrored) {
  const [w, h] = [x1 - x0, y1 - y0];
  const part = new rgba.constructor(4 * w * h);
  for (let y = 0; y < h; y++) {
    const from = 4 * ((y0 + y) * width + x0);
    part.set(rgba.subarray(from, from + 4 * w), 4 * y * w);
  }
  return { width: w, height: h, rgba: isMirrored ? mirrored(part, w, 4) : part };
}

/** Mirror values, row by row. */
const mirrored = (values, width, channels = 1) =>
  values.map((_, at) => values[at + channels * (width - 1 - 2 * (Math.floor(at / channels) % width))]);

function rangeOf(rgba) {
  const colors = rgba.filter((_, i) => i % 4 < 3);
  return colors.reduce((a, b) => Math.max(a, b)) - colors.reduce((a, b) => Math.min(a, b));
}
