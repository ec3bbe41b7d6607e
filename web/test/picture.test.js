/** A picture's transparency is a mask where it cuts something away, as in Python. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { maskFromAlpha } from "../src/photo/picture.js";
import { readMask, readNormals } from "../src/photo/source.js";

/** A picture of 8 x 4 grey pixels of this alpha, but for its first. */
function pictureOf(alpha, first = alpha) {
  const rgba = new Uint8ClampedArray(4 * 8 * 4).fill(90);
  for (let i = 3; i < rgba.length; i += 4) rgba[i] = alpha;
  rgba[3] = first;
  return { width: 8, height: 4, rgba };
}

test("alpha that cuts nothing away is no mask", () => {
  for (const [alpha, first] of [[255, 255], [254, 254], [255, 254], [255, 128], [0, 0], [100, 100]]) {
    assert.equal(maskFromAlpha(pictureOf(alpha, first)), null, `${alpha}, ${first}`);
  }
});

test("alpha that cuts something away is the mask as it is", () => {
  for (const [alpha, first] of [[255, 127], [254, 0], [0, 255]]) {
    const mask = maskFromAlpha(pictureOf(alpha, first));
    assert.equal(mask[0], Math.fround(first / 255));
    assert.ok(mask.slice(1).every((cover) => cover === Math.fround(alpha / 255)));
  }
});

test("a mask of any colour on black is the object", async () => {
  globalThis.ImageData = class {
    constructor(data, width, height) {
      Object.assign(this, { data, width, height });
    }
  };
  const picture = { width: 2, height: 1, fullWidth: 2, fullHeight: 1 };
  for (const color of [[255, 0, 0], [0, 0, 255], [128, 0, 0]]) {
    const mask = await readMask(new ImageData(Uint8ClampedArray.of(0, 0, 0, 255, ...color, 255), 2, 1), picture);
    assert.ok(mask[0] === 0 && mask[1] > 0.5);
  }
});

test("masks and normals of a photo's own size are shrunk as the photo was", async () => {
  const picture = { width: 8, height: 4, fullWidth: 16, fullHeight: 8 };
  const left = Float32Array.from({ length: 128 }, (_, i) => (i % 16 < 8 ? 1 : 0));
  const mask = await readMask(left, picture);
  assert.equal(mask.length, 32);
  assert.ok(mask[0] === 1 && mask[7] === 0);
  assert.equal(await readMask(mask, picture), mask);
  const normals = readNormals(Float32Array.from({ length: 384 }, (_, i) => (i % 3 === 2 ? 1 : 0)), picture);
  assert.equal(normals.length, 96);
  assert.ok(Math.abs(normals[2] - 1) < 1e-6 && normals[0] === 0);
  for (const wrong of [new Float32Array(9), Float32Array.of(NaN), new Float32Array(32).fill(255)]) {
    await assert.rejects(readMask(wrong, picture), { code: "invalid-option" });
  }
  assert.throws(() => readNormals([0, 0, 1], picture), { code: "invalid-option" });
});
