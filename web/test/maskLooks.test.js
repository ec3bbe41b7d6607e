/** Looks at a picture are kept: another mark on it, or on a camera's picture that shows the same, is answered without them. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { findMask } from "../src/networks/masks.js";

const [WIDTH, HEIGHT] = [240, 180];

/** Two bright squares before a dark wall, with the camera's noise. */
function picture(left, seed) {
  const rgba = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(255);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const [x, y] = [i % WIDTH, Math.floor(i / WIDTH)];
    seed = (seed * 16807) % 2147483647;
    const isIn = y > 50 && y < 120 && ((x >= left && x < left + 60) || (x > 150 && x < 210));
    rgba.fill((isIn ? 200 : 60) + (16 * seed) / 2147483647 - 8, 4 * i, 4 * i + 3);
  }
  return { width: WIDTH, height: HEIGHT, rgba };
}

test("a second click on what a camera still shows takes no look, nor one on another thing in it, and on another picture all", async () => {
  let looks = 0;
  const models = { sessions: { u2netp: {} }, cover: async (_, input) => (looks++, input.subarray(0, input.length / 3).map((value) => (value > 0 ? 1 : 0))) };
  const click = async (left, seed, x) => {
    looks = 0;
    const { mask } = await findMask(models, picture(left, seed), { on: [[x, 80]], off: [], box: null }, () => false);
    assert.ok(mask[80 * WIDTH + x] > 0.5);
    return looks;
  };
  const counts = [await click(30, 1, 60), await click(30, 2, 62), await click(30, 3, 180), await click(60, 4, 90)];
  assert.deepEqual(counts, [2, 0, 0, 2]);
});

test("a click that marks nothing is said", async () => {
  const models = { sessions: { u2netp: {} }, cover: async (_, input) => input.subarray(0, input.length / 3).map((value) => (value > 0 ? 1 : 0)) };
  const { warnings } = await findMask(models, picture(30, 1), { on: [[60, 80], [130, 20]], off: [], box: null }, () => false);
  assert.deepEqual(warnings.map(({ text }) => text.slice(0, 46)), ["the mask does not hold the click at 130,20; re"]);
});
