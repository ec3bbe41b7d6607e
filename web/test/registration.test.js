/** Where a known object lies in another picture, of moves that are known. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { beginKey, isSure, locateKey, matrixOf } from "../src/live/registration.js";

const { key: ABOUT, cases: CASES } = JSON.parse(readFileSync(new URL("../../tests/product/cases/registration.json", import.meta.url), "utf8"));
const { width, height } = ABOUT;
const bytesOf = (text) => Float32Array.from(Buffer.from(text, "base64"));
const motionOf = ([x, y, angle, scale]) => ({ x, y, angle, scale });
const key = beginKey({ width, height, values: bytesOf(ABOUT.picture) }, bytesOf(ABOUT.mask).map((value) => value / 255));
const isNear = (got, wanted, within, name) => assert.ok(Math.abs(got - wanted) <= within, `${name}: ${got}, expected ${wanted}`);

/** By how much two motions differ where places at the object's radius come to lie, pixels. */
function apart(one, other) {
  const [m, n] = [one, other].map(matrixOf);
  const places = [[1, 0], [0, 1], [-1, 0], [0, -1]].map((place) => place.map((value) => value * key.radius));
  return Math.max(
    ...places.flatMap(([u, v]) => [
      Math.abs(one.x - other.x + (m[0] - n[0]) * u + (m[1] - n[1]) * v),
      Math.abs(one.y - other.y + (m[2] - n[2]) * u + (m[3] - n[3]) * v),
    ]),
  );
}

for (const { name, picture, start, offset, truth, ...wanted } of CASES) {
  test(`an object is where the vectors have it: ${name}`, () => {
    const found = locateKey(key, { width, height, values: bytesOf(picture) }, motionOf(start), offset);
    assert.equal(isSure(found), wanted.is_sure);
    if (truth === null) return assert.equal(isSure(found), false);
    isNear(apart(found.motion, motionOf(truth)), 0, name.includes("shadow") ? 0.5 : 0.2, "from the truth");
    isNear(found.inside, wanted.inside, 0.005, "inside");
  });
}
