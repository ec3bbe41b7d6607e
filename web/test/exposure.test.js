/** Objects that are mostly black or clipped are said to be, as Python does. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { lightOfObject } from "../src/networks/lightOfObject.js";
import { said } from "./said.js";
import { exposureDoubts } from "../src/photo/exposure.js";

const [WIDTH, HEIGHT] = [200, 100];

/** Of its left half, the object: a share of one grey, the rest of another; beside it is white. */
function pictureOf(share, grey, rest = 128) {
  const rgba = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(255);
  const mask = new Float32Array(WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; y++) {
    for (let x = 0; x < WIDTH / 2; x++) {
      const at = y * WIDTH + x;
      mask[at] = 1;
      rgba.fill(x < share * (WIDTH / 2) ? grey : rest, 4 * at, 4 * at + 3);
    }
  }
  return { picture: { width: WIDTH, height: HEIGHT, rgba }, mask };
}

function doubts(share, grey) {
  const { picture, mask } = pictureOf(share, grey);
  return exposureDoubts(picture, mask).map(({ code, text }) => `${code}: ${text}`);
}

test("a black and a clipped object are doubtful, and what to do is said", () => {
  assert.deepEqual(doubts(0.9, 5), ["object-dark: 90% of the object is nearly black; little can be estimated from it; expose longer"]);
  assert.deepEqual(doubts(0.9, 254), ["object-clipped: 90% of the object is clipped; where its light comes from is uncertain; expose shorter"]);
});

test("others are not, nor is no object", () => {
  for (const [share, grey] of [[0.7, 5], [0.15, 254], [1, 20], [1, 246]]) assert.deepEqual(doubts(share, grey), [], `${share} ${grey}`);
  assert.deepEqual(exposureDoubts({ width: 1, height: 1, rgba: new Uint8ClampedArray(4) }, new Float32Array(1)), []);
});

test("it is among the warnings of a light", async () => {
  const models = { light: async () => said(0.5) };
  for (const [grey, count] of [[5, 1], [128, 0]]) {
    const { picture, mask } = pictureOf(1, grey);
    const { warnings } = await lightOfObject(models, picture, mask, 65, { surroundings: "none" });
    assert.equal(warnings.filter(({ code }) => code === "object-dark").length, count);
  }
});
