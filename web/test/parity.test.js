/**
 * The page computes what the Python package computes: one photo through both.
 *
 * PARITY names a folder that tests/support/parity_case.py fills: photo.rgba, mask.f32,
 * case.json and Python's answers as .f32.
 */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { before, test } from "node:test";
import * as ort from "onnxruntime-web";

import { cameraRadiance, describe } from "../src/light/light.js";
import { irradianceMap, blurCosinePower } from "../src/light/filtering.js";
import { shown, step } from "../src/light/temporal.js";
import { cropObject } from "../src/photo/crop.js";
import { propose } from "../src/photo/propose.js";
import { seeAround, useSurroundings } from "../src/photo/surroundings.js";
import { response } from "../src/core/response.js";
import { Models } from "../src/networks/models.js";

const folder = process.env.PARITY;
const skip = folder ? false : "PARITY names no folder with Python's answers";
const found = {};

function floats(name) {
  const bytes = readFileSync(join(folder, `${name}.f32`));
  return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
}

function assertClose(actual, expected, tolerance, what) {
  assert.equal(actual.length, expected.length, what);
  let worst = 0;
  for (let i = 0; i < expected.length; i++) {
    worst = Math.max(worst, Math.abs(actual[i] - expected[i]) / (1 + Math.abs(expected[i])));
  }
  assert.ok(worst <= tolerance, `${what}: off by ${worst}`);
}

/** The last bit of a direction may lift a pixel to its neighbour: a few may differ. */
function assertMostlyClose(actual, expected, tolerance, what) {
  assert.equal(actual.length, expected.length, what);
  const off = expected.map((value, i) => Math.abs(actual[i] - value) / (1 + Math.abs(value))).sort();
  const worst = off[Math.floor(0.99 * off.length)];
  assert.ok(worst <= tolerance, `${what}: one in a hundred off by ${worst}`);
}

before(async () => {
  if (skip) return;
  const told = JSON.parse(readFileSync(join(folder, "case.json")));
  const { width, height, long_fov_deg, weights } = told;
  const rgba = new Uint8ClampedArray(readFileSync(join(folder, "photo.rgba")));
  Object.assign(found, { picture: { width, height, rgba }, longFovDeg: long_fov_deg, hints: told.hints, frameSeconds: told.frame_seconds });
  found.crop = cropObject(found.picture, floats("mask"), long_fov_deg);
  ort.env.wasm.numThreads = 1;
  const bytes = Object.fromEntries(
    Object.entries(weights).map(([stage, path]) => [stage, new Uint8Array(readFileSync(path))]),
  );
  found.models = await Models.open(ort, bytes);
  found.stages = await found.models.light(found.crop.image, found.crop.tanHalf);
  found.light = describe(cameraRadiance(found.stages, found.crop.cameraFromCrop));
});

test("the crop and its camera", { skip }, () => {
  assertClose(found.crop.image, floats("crop"), 1e-5, "crop");
  assertClose([found.crop.tanHalf], floats("tan_half"), 1e-6, "tan_half");
  assertClose(found.crop.cameraFromCrop, floats("camera_from_crop"), 1e-6, "camera_from_crop");
});

test("the stages", { skip }, () => {
  assertClose(found.stages.irradiance, floats("irradiance"), 2e-4, "irradiance");
  assertMostlyClose(found.stages.ldr, floats("ldr"), 1e-3, "ldr");
  assertMostlyClose(found.stages.lnRadiance, floats("ln_radiance"), 2e-3, "ln_radiance");
});

test("the map in the camera's frame", { skip }, () => {
  assertMostlyClose(found.light.radiance, floats("radiance"), 3e-3, "radiance");
});

test("what the photo shows around the object, and the map with it", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain has no use for it");
  const { crop, picture } = found;
  const around = seeAround(picture, found.longFovDeg, crop);
  assertClose(around, floats("around"), 2e-3, "around");
  const stages = useSurroundings(await found.models.light(crop.image, crop.tanHalf, { around }), around);
  assertMostlyClose(cameraRadiance(stages, crop.cameraFromCrop), floats("radiance_told"), 3e-3, "radiance told");
  assertMostlyClose(stages.ldr, stages.radiance.map((value) => response(value)), 1e-6, "ldr told");
});

test("spread lamps", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain knows only those that it draws");
  const { crop } = found;
  const stages = await found.models.light(crop.image, crop.tanHalf, { spread: true });
  assertMostlyClose(cameraRadiance(stages, crop.cameraFromCrop), floats("radiance_spread"), 3e-3, "radiance spread");
  assertMostlyClose(stages.ldr, stages.radiance.map((value) => response(value)), 1e-6, "ldr spread");
});

test("one colour behind the object is no place", { skip }, () => {
  const { crop, picture } = found;
  const plain = { ...picture, rgba: new Uint8ClampedArray(picture.rgba.length).fill(200) };
  assert.equal(seeAround(plain, found.longFovDeg, crop), null);
});

test("harmonics and dominant light of Python's own map", { skip }, () => {
  const light = describe(floats("radiance"));
  assertClose(light.sh9, floats("sh9"), 1e-5, "sh9");
  const { direction, irradiance, color, solidAngle, confidence } = light.dominant;
  const main = [...direction, ...irradiance, ...color, solidAngle, confidence];
  assertClose(main, floats("dominant_light"), 1e-4, "dominant light");
});

test("the mask that is proposed from nothing, from clicks and from a box", { skip }, async () => {
  for (const [name, hints] of Object.entries(found.hints)) {
    const cover = await propose((input) => found.models.mask(input), found.picture, hints);
    assertClose(cover.values, floats(`cover_${name}`), 1e-4, `cover ${name}`);
  }
});

test("the filter of a video's lights", { skip }, () => {
  const frames = floats("frames");
  const size = frames.length / found.frameSeconds.length;
  let state = null;
  found.frameSeconds.forEach((dt, i) => {
    state = step(state, frames.subarray(i * size, (i + 1) * size), dt);
  });
  assertClose(shown(state), floats("steadied"), 1e-4, "steadied");
});

test("blurs of Python's own map", { skip }, () => {
  assertClose(irradianceMap(floats("radiance"), 64), floats("irradiance_map"), 1e-4, "irradiance map");
  assertClose(blurCosinePower(floats("radiance"), 64, 3, 5), floats("blurred"), 1e-4, "blur");
});
