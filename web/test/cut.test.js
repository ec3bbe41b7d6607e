/** Cuts of small grids beside every possible cut, and pictures whose object is plain to see. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { boxLabels, cutOut, cutOutOfBox } from "../src/photo/cutOut.js";
import { MAYBE_ON, OFF } from "../src/photo/grabcut.js";
import { MaxFlow, STEPS } from "../src/photo/maxflow.js";

const [COLUMNS, ROWS] = [4, 3];

/** Numbers in [0, 1) that are the same every time (an LCG of Numerical Recipes). */
function numbers(seed) {
  let state = seed;
  return () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
}

const nodeOf = (pixel) => (Math.floor(pixel / COLUMNS) + 1) * (COLUMNS + 2) + (pixel % COLUMNS) + 1;

/** Pairs of neighbours, each once: two pixels, and the step from the first to the second. */
function neighbours() {
  const pairs = [];
  for (let a = 0; a < COLUMNS * ROWS; a++) {
    STEPS.forEach(([dx, dy], step) => {
      const [x, y] = [(a % COLUMNS) + dx, Math.floor(a / COLUMNS) + dy];
      if (step % 2 === 0 && x >= 0 && x < COLUMNS && y >= 0 && y < ROWS) pairs.push([a, y * COLUMNS + x, step]);
    });
  }
  return pairs;
}

/** What it costs to have the pixels of a bit set on the source's side. */
function costOf(set, excess, ties) {
  let cost = 0;
  excess.forEach((value, pixel) => {
    const isSource = (set >> pixel) & 1;
    if (isSource && value < 0) cost -= value;
    if (!isSource && value > 0) cost += value;
  });
  for (const [a, b, , tie] of ties) if (((set >> a) & 1) !== ((set >> b) & 1)) cost += tie;
  return cost;
}

function cutSet(flow) {
  let set = 0;
  for (let pixel = 0; pixel < COLUMNS * ROWS; pixel++) if (flow.isSource(nodeOf(pixel))) set |= 1 << pixel;
  return set;
}

function leastCost(excess, ties) {
  let least = Infinity;
  for (let set = 0; set < 1 << (COLUMNS * ROWS); set++) least = Math.min(least, costOf(set, excess, ties));
  return least;
}

test("no cut of a grid is cheaper, the first time and after the excess has changed", () => {
  for (let seed = 1; seed <= 40; seed++) {
    const random = numbers(seed);
    const ties = neighbours().map((pair) => [...pair, Math.floor(8 * random())]);
    const flow = new MaxFlow(COLUMNS + 2, ROWS + 2);
    for (const [a, b, step, tie] of ties) {
      flow.left[8 * nodeOf(a) + step] = tie;
      flow.left[8 * nodeOf(b) + (step ^ 1)] = tie;
    }
    let excess = new Array(COLUMNS * ROWS).fill(0);
    for (let round = 0; round < 3; round++) {
      const next = excess.map(() => Math.floor(41 * random()) - 20);
      next.forEach((value, pixel) => (flow.excess[nodeOf(pixel)] += value - excess[pixel]));
      excess = next;
      flow.cut();
      assert.equal(costOf(cutSet(flow), excess, ties), leastCost(excess, ties), `seed ${seed}, round ${round}`);
    }
  }
});

const [WIDTH, HEIGHT] = [120, 90];
const isInDisc = (x, y, radius = 25) => Math.hypot(x + 0.5 - 60, y + 0.5 - 45) < radius;

/** A shaded disc, with a rod of the same colour beside it that a coarse proposal misses, on a noisy ground. */
function discPicture() {
  const random = numbers(7);
  const rgba = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(255);
  for (let y = 0, i = 0; y < HEIGHT; y++) {
    for (let x = 0; x < WIDTH; x++, i += 4) {
      const noise = 30 * random();
      const color = isObject(x, y) ? [200 - y, 90 - y / 2, 40] : [60, 100, 120];
      for (let c = 0; c < 3; c++) rgba[i + c] = color[c] + noise;
    }
  }
  return { width: WIDTH, height: HEIGHT, rgba };
}

const isObject = (x, y) => isInDisc(x, y) || (x >= 60 && x < 92 && y >= 42 && y < 47);

function proposal(isInside) {
  const values = Float32Array.from({ length: WIDTH * HEIGHT }, (_, i) => (isInside(i % WIDTH, Math.floor(i / WIDTH)) ? 1 : 0));
  return { values, width: WIDTH, height: HEIGHT, confidence: 1 };
}

const NO_CLICKS = { on: [], off: [] };

function iou(mask, isInside) {
  let [both, either] = [0, 0];
  mask.forEach((value, i) => {
    const [found, meant] = [value > 0.5, isInside(i % WIDTH, Math.floor(i / WIDTH))];
    both += found && meant;
    either += found || meant;
  });
  return both / either;
}

test("a rough proposal moves to the object's outline, and to its thin parts", () => {
  const mask = cutOut(discPicture(), proposal((x, y) => isInDisc(x, y, 20)), NO_CLICKS);
  assert.ok(iou(mask, isObject) > 0.95, `IoU ${iou(mask, isObject)}`);
});

test("clicks are believed", () => {
  const clicks = { on: [[20, 45]], off: [[60, 45]] };
  const mask = cutOut(discPicture(), proposal((x, y) => isInDisc(x, y, 20)), clicks);
  assert.equal(mask[45 * WIDTH + 20], 1);
  assert.equal(mask[45 * WIDTH + 60], 0);
});

test("where there is nothing to cut, nothing is found or what was clicked", () => {
  const nowhere = proposal(() => false);
  assert.ok(cutOut(discPicture(), nowhere, NO_CLICKS).every((value) => value === 0));
  assert.ok(cutOut(discPicture(), proposal(() => true), NO_CLICKS).every((value) => value === 0));
  assert.ok(cutOut(discPicture(), nowhere, { on: [[60, 45]], off: [] })[45 * WIDTH + 60] === 1);
});

const BOX = [30, 15, 98, 75];

test("a box is perhaps the object, and nothing outside it is", () => {
  const labels = boxLabels([2.9, 1.2, 5.6, 3.4], [8, 5]);
  const isInside = (i) => i % 8 >= 2 && i % 8 < 6 && i >= 8 && i < 24;
  labels.forEach((label, i) => assert.equal(label, isInside(i) ? MAYBE_ON : OFF, `pixel ${i}`));
});

test("a box at the far corner has a pixel, a box around everything has surroundings", () => {
  assert.deepEqual([...boxLabels([8, 5, 8, 5], [8, 5])].flatMap((label, i) => (label === MAYBE_ON ? [i] : [])), [39]);
  const rows = boxLabels([0, 0, 8, 5], [8, 5]);
  rows.forEach((label, i) => assert.equal(label, i % 8 === 0 || i % 8 === 7 ? OFF : MAYBE_ON));
});

test("what a box has inside is cut out, thin parts too, and clicks correct it", () => {
  const found = cutOutOfBox(discPicture(), { ...NO_CLICKS, box: BOX });
  assert.ok(iou(found, isObject) > 0.95, `IoU ${iou(found, isObject)}`);
  const clicks = { on: [[20, 45]], off: [[90, 44]] };
  const corrected = cutOutOfBox(discPicture(), { ...clicks, box: BOX });
  assert.equal(corrected[45 * WIDTH + 20], 1);
  assert.equal(corrected[44 * WIDTH + 90], 0);
});

test("nothing outside a box is found, whatever it looks like", () => {
  const most = cutOutOfBox(discPicture(), { ...NO_CLICKS, box: [30, 15, 80, 75] });
  most.forEach((value, i) => assert.ok(i % WIDTH < 82 || value === 0));
  assert.ok(most[45 * WIDTH + 60] === 1);
});

test("a large picture's box is made small with it", () => {
  const [width, height] = [8 * WIDTH, 8 * HEIGHT];
  const { rgba } = discPicture();
  const large = new Uint32Array(width * height);
  const pixels = new Uint32Array(rgba.buffer);
  large.forEach((_, i) => (large[i] = pixels[Math.floor(i / width / 8) * WIDTH + Math.floor((i % width) / 8)]));
  const picture = { width, height, rgba: new Uint8ClampedArray(large.buffer) };
  const found = cutOutOfBox(picture, { ...NO_CLICKS, box: BOX.map((value) => 8 * value) });
  const shrunk = Float32Array.from({ length: WIDTH * HEIGHT }, (_, i) => found[(8 * Math.floor(i / WIDTH) + 4) * width + 8 * (i % WIDTH) + 4]);
  assert.ok(iou(shrunk, isObject) > 0.95, `IoU ${iou(shrunk, isObject)}`);
});

test("a picture of one colour gives numbers", () => {
  const flat = { width: WIDTH, height: HEIGHT, rgba: new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(99) };
  assert.ok(cutOut(flat, proposal((x, y) => isInDisc(x, y)), NO_CLICKS).every((value) => value >= 0 && value <= 1));
});
