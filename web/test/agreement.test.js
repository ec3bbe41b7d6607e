/** A mask that the network finds again in other ways is trusted, one that it does not find again is not. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { agreement } from "../src/photo/agreement.js";

const SIZE = 160;
const picture = { width: SIZE, height: SIZE, rgba: new Uint8ClampedArray(4 * SIZE * SIZE) };
for (let i = 0; i < SIZE * SIZE; i++) {
  const [x, y] = [i % SIZE, Math.floor(i / SIZE)];
  picture.rgba.set(x >= 20 && x < 140 && y >= 20 && y < 140 && x + y < 200 ? [200, 200, 200, 255] : [20, 20, 20, 255], 4 * i);
}
const NONE = { on: [], off: [], box: null };
const bright = (input) => Float32Array.from({ length: SIZE * SIZE }, (_, i) => (input[i] > 0.5 ? 0.95 : 0.02));
const mask = Float32Array.from({ length: SIZE * SIZE }, (_, i) => (picture.rgba[4 * i] > 100 ? 1 : 0));

test("the same object in the mirror and in a box is trusted", async () => {
  assert.ok((await agreement(async (input) => bright(input), picture, mask, NONE)) > 0.95);
});

test("what is found in one of them alone is not, nor is nothing", async () => {
  const left = (input) => bright(input).map((value, i) => (i % SIZE < SIZE / 2 ? value : 0.02));
  assert.ok((await agreement(async (input) => left(input), picture, mask, NONE)) < 0.8);
  const boxed = (input) => input.subarray(3 * SIZE * SIZE).some((value) => value > 0);
  const part = async (input) => (boxed(input) ? new Float32Array(SIZE * SIZE).fill(0.02) : bright(input));
  assert.ok((await agreement(part, picture, mask, NONE)) < 0.1);
  assert.equal(await agreement(async (input) => bright(input), picture, new Float32Array(SIZE * SIZE), NONE), 0);
});

test("clicks are mirrored with the picture", async () => {
  const seen = [];
  const look = async (input) => {
    const hints = input.subarray(3 * SIZE * SIZE);
    seen.push(hints.indexOf(Math.max(...hints)) % SIZE);
    return bright(input);
  };
  await agreement(look, picture, mask, { on: [[30.5, 60.5]], off: [], box: null });
  assert.equal(seen[0], 129);
});
