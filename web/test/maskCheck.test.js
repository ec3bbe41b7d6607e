/** An object that is too small is told of by what marked it. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { checkObject } from "../src/photo/maskCheck.js";

const mask = Float32Array.from({ length: 900 }, (_, i) => (i % 30 < 9 && i < 270 ? 1 : 0));
const small = "expected an object of 24 pixels across or more, got 9";

test("too small an object comes with what mends it", () => {
  for (const [subject, line] of [
    [[], `${small}; go closer`],
    [["mask"], `mask: ${small}; go closer`],
    [["click"], `click: ${small}; go closer; give box or mask`],
    [["click", "box"], `box: ${small}; draw it around the whole object`],
  ]) {
    assert.throws(() => checkObject(mask, 30, subject), { code: "no-object", message: line });
  }
  assert.throws(() => checkObject(new Float32Array(900), 30, ["mask"]), { code: "no-object", message: "mask: expected an object, got no value above 0.5" });
  checkObject(new Float32Array(900).fill(1), 30);
});
