/** What may be said of the object's material, and what is refused. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { MATERIALS, givenMaterial, materialInput } from "../src/photo/material.js";

test("a name, an albedo and a roughness", () => {
  assert.deepEqual(givenMaterial("chrome").albedo, [0, 0, 0]);
  const clay = givenMaterial({ albedo: 0.3, roughness: 0.5 });
  assert.deepEqual(clay, { albedo: [0.3, 0.3, 0.3], f0: [0.04, 0.04, 0.04], alpha: 0.25 });
});

test("measured materials have Python's names", () => {
  assert.deepEqual(givenMaterial("porcelain"), { albedo: [0.745, 0.745, 0.723], f0: [0.04, 0.04, 0.04], alpha: 0.01 });
  assert.ok(Object.keys(MATERIALS).length > 50);
});

test("what no surface has is refused in one line", () => {
  for (const wrong of ["unobtainium", { roughness: 0 }, { roughness: 2 }, { albedo: 0 }, { albedo: [1, 1] }, { name: "gold", albedo: 0.5 }, { albedo: null }, { albedo: {} }]) {
    assert.throws(() => givenMaterial(wrong), /^AnyProbeError: material(\.roughness|\.albedo)?: expected [^\n]+$/);
  }
});

test("what says nothing of a material is refused", () => {
  for (const wrong of [5, {}, null, true, [0.5], { colour: 1 }, { albedo: 0.5, rough: 1 }, { albedo: undefined }]) {
    assert.throws(() => givenMaterial(wrong), /^AnyProbeError: material: expected a name, or an object of name, albedo, roughness, got /, JSON.stringify(wrong));
  }
});

test("a perfect mirror reflects everything, black velvet next to nothing", () => {
  const mirror = materialInput({ albedo: [0, 0, 0], f0: [1, 1, 1], alpha: 0.01 });
  assert.deepEqual([...mirror].map((x) => Math.round(10 * x) / 10), [1, 0.1, 0, 0, 0, 1, 1, 1]);
  const velvet = materialInput({ albedo: [0, 0, 0], f0: [0, 0, 0], alpha: 1 });
  assert.ok(velvet[2] < -3 && velvet[2] > -4);
});
