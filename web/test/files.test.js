/** What is written as a file is a map of the size that is said. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { encodeExr } from "../src/files/exr.js";
import { encodeHdr } from "../src/files/hdr.js";

test("a map of another size than is said is refused", async () => {
  const refused = { name: "AnyProbeError", code: "invalid-option" };
  const map = new Float32Array(6 * 16).fill(0.5);
  assert.equal(String.fromCharCode(...encodeHdr(map, 4).subarray(0, 10)), "#?RADIANCE");
  assert.ok((await encodeExr(map, 4)).length > 0);
  for (const [radiance, height, message] of [
    [map, 64, "radiance: expected 64 x 128 x 3 numbers, got 96; pass light.radiance and 64"],
    [undefined, 4, /got none;/],
    [map, undefined, "height: it is missing; pass light.radiance and 64"],
    [new Float32Array(0), 0, /^height: .* got 0/],
    [map.with(7, NaN), 4, /^radiance: expected finite numbers, got NaN/],
  ]) {
    assert.throws(() => encodeHdr(radiance, height), { ...refused, message });
    await assert.rejects(encodeExr(radiance, height), { ...refused, message });
  }
});

test("plain numbers are written, and what is below zero as black", async () => {
  const map = new Float32Array(6 * 16).fill(0.5);
  assert.deepEqual(await encodeExr([...map], 4), await encodeExr(map, 4));
  const [below, black] = [-0.1, 0].map((value) => encodeHdr(map.with(7, value), 4));
  assert.deepEqual(below, black);
});
