/** What a given mask holds beside its object is dropped, by the cases of tests/product/test_mask_specks.py. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { lookAtGiven } from "../src/photo/maskCheck.js";
import { objectBox } from "../src/photo/picture.js";

const { width, height, object, cases } = JSON.parse(readFileSync(new URL("../../tests/product/cases/mask_specks.json", import.meta.url), "utf8"));

function drawn(shapes) {
  const mask = new Float32Array(width * height);
  for (const [kind, value, [a, b, c, d]] of shapes) {
    const square = (x, y) => (x - a) ** 2 + (y - b) ** 2;
    const isIn = {
      salt: (x, y) => (y * width + x) % a === 0,
      rect: (x, y) => x >= a && x < c && y >= b && y < d,
      disc: (x, y) => square(x, y) < c ** 2,
      ring: (x, y) => square(x, y) < c ** 2 && square(x, y) >= (c - d) ** 2,
    }[kind];
    for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) if (isIn(x, y)) mask[y * width + x] = value;
  }
  return mask;
}

for (const { name, object: own = object, more, keeps, said = [], slack = 0 } of cases) {
  test(`only what belongs to the object stays: ${name}`, () => {
    const given = drawn([...own, ...more]);
    const { mask, warnings } = lookAtGiven(given, width);
    assert.deepEqual(warnings.map(({ code }) => code), said);
    if (keeps) return assert.deepEqual(mask, given);
    const alone = drawn(own);
    const [found, expected] = [mask, alone].map((one) => objectBox(one, width));
    assert.ok(found.every((at, i) => Math.abs(at - expected[i]) <= slack), `${found} for ${expected}`);
    assert.ok(mask.filter((value, i) => value > 0.5 !== alone[i] > 0.5).length < 1e-3 * mask.length);
  });
}
