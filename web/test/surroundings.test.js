/** What is beside the object: whether it may be used, and what is said where it is not; as anyprobe.estimate.refine. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { lightOfObject } from "../src/networks/lightOfObject.js";
import { said } from "./said.js";

const [WIDTH, HEIGHT] = [64, 48];
const mask = new Float32Array(WIDTH * HEIGHT).fill(1, 0, 640);

/** A grey picture, transparent beside the object where that is wanted. */
function pictureOf(grey, alpha = 255) {
  const rgba = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(grey);
  for (let i = 0; i < mask.length; i++) rgba[4 * i + 3] = mask[i] ? 255 : alpha;
  return { width: WIDTH, height: HEIGHT, rgba };
}

const lightOf = (picture, believed, options = {}) =>
  lightOfObject({ light: async () => said(0.4, { believed: [believed] }) }, picture, mask, 60, options);
const codesOf = async (...given) => (await lightOf(...given)).warnings.map(({ code }) => code);

test("a backdrop that is not used is said; the black of a cut-out and transparency are not", async () => {
  assert.deepEqual(await codesOf(pictureOf(230), 0.1), ["plain-backdrop"]);
  assert.ok(!(await codesOf(pictureOf(0), 0.1)).includes("plain-backdrop"));
  assert.deepEqual(await codesOf(pictureOf(230, 0), 0.1), []);
});

test("a background that is not used leaves the ground unknown", async () => {
  assert.equal((await lightOf(pictureOf(100), 0.1)).ground, null);
  assert.equal((await lightOf(pictureOf(100), 0.9)).ground.source, "estimated");
  assert.equal((await lightOf(pictureOf(100), 0.9, { pitchDeg: 10 })).ground.source, "given");
});

test("the lens is the narrow end of the network's where nothing else says it", async () => {
  assert.equal((await lightOf(pictureOf(100), 0.9, { isLensKnown: false })).lens.longFovDeg, 55);
  assert.equal((await lightOf(pictureOf(100), 0.9, { isLensKnown: true })).lens, undefined);
});

test("what is transparent is not used, unless the whole photo is asked for", async () => {
  const shares = [];
  const light = async ({ photo: [values] }) => {
    shares.push(values.reduce((sum, value, i) => sum + (i % 5 === 3 ? value : 0), 0) / mask.length);
    return said(0.4);
  };
  for (const surroundings of ["auto", "photo", "none"]) await lightOfObject({ light }, pictureOf(100, 0), mask, 60, { surroundings });
  assert.deepEqual(shares, [640 / mask.length, 1, 640 / mask.length]);
});
