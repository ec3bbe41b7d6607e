/** A slip of the pen is answered with what was meant, by Python's rule: tests/product/test_spelling.py has the same cases. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { checkSetup } from "../src/networks/setup.js";
import { checkNames } from "../src/checks.js";
import { MATERIALS, givenMaterial } from "../src/photo/material.js";
import { didYouMean } from "../src/spelling.js";

const cases = JSON.parse(readFileSync(new URL("../../tests/product/cases/misspelt.json", import.meta.url), "utf8"));

test("what Python says of a name is said here", () => {
  for (const { name, known, said } of cases) {
    assert.equal(didYouMean(name, known === "materials" ? Object.keys(MATERIALS) : known), said, name);
  }
});

test("names of options have capitals, and what is no text is like none", () => {
  assert.equal(didYouMean("fovdeg", ["fovDeg", "pitchDeg"]), "; did you mean fovDeg?");
  for (const name of [undefined, null, 2, {}, Object.create(null), Symbol("gold")]) assert.equal(didYouMean(name, ["gold"]), "");
  assert.equal(didYouMean("gold".repeat(1e6), Object.keys(MATERIALS)), "");
});

for (const [list, ask, meant] of [
  ["materials", () => givenMaterial("golden"), "gold"],
  ["parts of a material", () => givenMaterial({ name: "gold", rougness: 0.5 }), "roughness"],
  ["surroundings", () => checkNames("tracker.set", { surroundings: "phot" }), "photo"],
  ["options", () => checkNames("estimate", { clik: [1, 2] }), "click"],
  ["graphs", () => checkSetup({ weights: { lihgt: "light.onnx" } }, { worker: () => {} }), "light"],
]) {
  test(`of ${list} the one that was meant is named`, () => {
    assert.throws(ask, (error) => error.code === "invalid-option" && error.message.endsWith(`; did you mean ${meant}?`) || assert.fail(error.message));
  });
}
