/** What colours say against a mask; tests/product/test_mask_words.py has the same cases. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { colorDoubts } from "../src/photo/colorDoubts.js";

const [SIDE, RED, BLUE] = [80, [200, 60, 50], [50, 70, 190]];
const TWO = "it may contain two objects of different colours";
const LOCAL = "the click is on a small part of what was found; a box around the object helps";

/** A mask of 64 x 64 in a picture of 80 x 80, each pixel of a colour of its place in the mask. */
function doubtsOf(colorAt, clicks = []) {
  const rgba = new Uint8ClampedArray(4 * SIDE * SIDE).fill(255);
  const mask = new Float32Array(SIDE * SIDE);
  for (let y = 0; y < 64; y++) {
    for (let x = 0; x < 64; x++) {
      const at = (y + 8) * SIDE + x + 8;
      mask[at] = 1;
      rgba.set(colorAt(x, y), 4 * at);
    }
  }
  return colorDoubts({ width: SIDE, height: SIDE, rgba }, mask, clicks);
}

test("two colours beside each other are two things", () => {
  assert.deepEqual(doubtsOf((x) => (x < 40 ? RED : BLUE)), [TWO]);
});

test("one colour, light and dark, or two that are mixed, are one", () => {
  assert.deepEqual(doubtsOf((x, y) => RED.map((value) => value * (0.4 + y / 110))), []);
  assert.deepEqual(doubtsOf((x, y) => ((Math.floor(x / 4) + Math.floor(y / 4)) % 2 ? RED : BLUE)), []);
});

test("a click on a small part is told", () => {
  const dot = (x, y) => (Math.hypot(x - 50, y - 50) < 8 ? BLUE : RED);
  assert.deepEqual(doubtsOf(dot, [[58, 58]]), [LOCAL]);
  assert.deepEqual(doubtsOf(dot, [[20, 20]]), []);
});
