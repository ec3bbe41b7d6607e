/** Sharp reflections: a detailed map's where surfaces mirror, the plain one's for diffuse light; and the file it comes in. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { pixelDirections } from "../src/core/latlong.js";
import { decodeHdr, encodeHdr } from "../src/files/hdr.js";
import { prefilter, prefilterSharp, SHARP_FACE_SIZES } from "../src/light/prefilter.js";

const HEIGHT = 256;

/** A map that is darker below, with stripes of two degrees if it is sharp. */
function mapOf(height, isSharp) {
  const directions = pixelDirections(height);
  return Float32Array.from({ length: directions.length }, (_, i) => {
    const at = i - (i % 3);
    const azimuth = Math.atan2(directions[at], -directions[at + 2]);
    const stripe = isSharp ? 0.5 * Math.sign(Math.sin(90 * azimuth)) : 0;
    return (1 + 0.8 * directions[at + 1]) * (1 + stripe);
  });
}

const spread = (values) => {
  const red = values.filter((_, i) => i % 4 === 0);
  const mean = red.reduce((sum, value) => sum + value, 0) / red.length;
  return Math.sqrt(red.reduce((sum, value) => sum + (value - mean) ** 2, 0) / red.length);
};

test("what mirrors is the detailed map's, what is dull the plain one's", () => {
  const plain = prefilter(mapOf(64, false));
  const levels = prefilterSharp(mapOf(HEIGHT, true), HEIGHT, plain);
  assert.deepEqual(levels.map((values) => values.length), SHARP_FACE_SIZES.map((size) => 24 * size * size));
  assert.equal(levels.at(-1), plain.at(-1));
  const smooth = prefilterSharp(mapOf(HEIGHT, false), HEIGHT, plain);
  assert.ok(spread(levels[0]) > 1.2 * spread(smooth[0]), "stripes are seen in a mirror");
  for (const level of [2, 3]) {
    const off = Math.max(...levels[level].map((value, i) => Math.abs(value - smooth[level][i])));
    assert.ok(off < 0.05, `level ${level} is blurred: ${off}`);
    assert.ok(spread(levels[level]) > 0.3, "and not empty");
  }
});

test("an .hdr file is read as it was written, with runs and without", () => {
  const radiance = mapOf(64, true).map((value, i) => value * 4 ** ((i % 7) - 3));
  const found = decodeHdr(encodeHdr(radiance, 64));
  assert.equal(found.height, 64);
  found.radiance.forEach((value, i) => {
    const at = i - (i % 3);
    const largest = Math.max(radiance[at], radiance[at + 1], radiance[at + 2]);
    assert.ok(Math.abs(value - radiance[i]) <= largest / 256, `${i}: ${value} ${radiance[i]}`);
  });
  const header = [...new TextEncoder().encode("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n")];
  const row = [2, 2, 0, 8, 128 + 8, 64, 3, 1, 2, 3, 128 + 5, 4, 128 + 8, 0, 128 + 8, 129];
  const small = decodeHdr(Uint8Array.from([...header, ...row, ...row, ...row, ...row])).radiance;
  assert.equal(small.length, 96);
  assert.deepEqual([...small.slice(0, 12)].map((value) => 128 * value), [64, 1, 0, 64, 2, 0, 64, 3, 0, 64, 4, 0]);
});
