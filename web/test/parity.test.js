/**
 * JavaScript computes what the Python package computes: one photo through both, by one set of vectors that Python writes.
 *
 * PARITY names a folder that tests/support/parity_case.py fills: photo.rgba, mask.f32,
 * case.json and Python's answers as .f32.
 */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { before, test } from "node:test";
import * as ort from "onnxruntime-web";

import { Light, brightestSide, describe } from "../src/light/light.js";
import { blurCosinePower } from "../src/light/filtering.js";
import { splitSources } from "../src/light/lightSources.js";
import { shown, shownSources, step } from "../src/light/temporal.js";
import { lookAtGiven } from "../src/photo/maskCheck.js";
import { groundDoubts } from "../src/photo/ground.js";
import { SmallNetwork } from "../src/photo/maskNetworks.js";
import { doubtOf, expectedIou } from "../src/photo/quality.js";
import { Looks, findObject, maskOf } from "../src/photo/search.js";
import { inverseResponse, response } from "../src/core/response.js";
import { lightOfStill } from "../src/networks/lightOfStill.js";
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
  const worst = Math.max(...batches(offBy(actual, expected)));
  assert.ok(worst <= tolerance, `${what}: off by ${worst}`);
}

/** By how much each number is off; what is no number is off by all there is. */
function offBy(actual, expected) {
  return Float64Array.from(expected, (value, i) => {
    const off = Math.abs(actual[i] - value) / (1 + Math.abs(value));
    return Number.isNaN(off) ? Infinity : off;
  });
}

/** The largest of every thousand: Math.max takes no more than some ten thousand. */
function batches(values) {
  return Array.from({ length: Math.ceil(values.length / 1000) }, (_, i) => Math.max(...values.subarray(1000 * i, 1000 * (i + 1))));
}

/** The last bit of a direction may lift a pixel to its neighbour: a few may differ. */
function assertMostlyClose(actual, expected, tolerance, what) {
  assert.equal(actual.length, expected.length, what);
  const off = offBy(actual, expected).sort();
  const worst = off[Math.floor(0.99 * off.length)];
  assert.ok(worst <= tolerance, `${what}: one in a hundred off by ${worst}`);
}

before(async () => {
  if (skip) return;
  const given = JSON.parse(readFileSync(join(folder, "case.json")));
  const { width, height, long_fov_deg, weights } = given;
  const rgba = new Uint8ClampedArray(readFileSync(join(folder, "photo.rgba")));
  Object.assign(found, { picture: { width, height, rgba }, longFovDeg: long_fov_deg, hints: given.hints, materials: given.materials, frameSeconds: given.frame_seconds, groundDoubts: given.ground_doubts, balls: given.balls, givenMasks: given.given_masks, found: given.found, lights: given.lights });
  ort.env.wasm.numThreads = 1;
  const bytes = Object.fromEntries(
    Object.entries(weights).map(([stage, path]) => [stage, new Uint8Array(readFileSync(path))]),
  );
  found.models = await Models.open(ort, bytes);
});

test("what is no number is not close to one, wherever it stands", () => {
  for (const at of [0, 500, 999]) {
    const numbers = Float32Array.from({ length: 1000 }, (_, i) => i);
    const broken = numbers.slice().fill(NaN, at, at + 1);
    assertClose(numbers, numbers, 0, "same");
    assertMostlyClose(numbers, numbers, 0, "same");
    assert.throws(() => assertClose(broken, numbers, 1, "broken"), /off by Infinity/);
    assert.throws(() => assertClose(numbers, broken, 1, "broken"), /off by Infinity/);
    const many = numbers.slice().fill(NaN, at - at / 9, at + 11);
    assert.throws(() => assertMostlyClose(many, numbers, 1, "broken"), /off by Infinity/);
  }
});

test("what is odd about a given mask is said in the same words", { skip }, () => {
  found.givenMasks.forEach(({ width, said }, index) => {
    const { mask, warnings } = lookAtGiven(floats(`given_${index}`), width);
    assert.deepEqual(warnings.map(({ code, text }) => [code, text]), said);
    assertClose(mask, floats(`given_${index}_read`), 1e-6, `given mask ${index}`);
  });
  assert.equal(new Set(found.givenMasks.flatMap(({ said }) => said.map(([, text]) => text))).size, 4);
});

test("an unsure pitch is said in the same words", { skip }, () => {
  for (const { pitch_deg: pitchDeg, error_deg: pitchErrorDeg, source, said } of found.groundDoubts) {
    const lines = groundDoubts({ pitchDeg, pitchErrorDeg, source });
    assert.deepEqual(lines.map(({ code, text }) => [code, text]), said);
  }
  assert.deepEqual(groundDoubts(null), []);
});

test("the camera's curve and its inverse", { skip }, () => {
  const steps = Float32Array.from({ length: 256 }, (_, i) => i / 200);
  assertClose(steps.map(response), floats("curve"), 1e-6, "curve");
  assertClose(steps.map(inverseResponse), floats("curve_inverse"), 1e-6, "inverse");
});

const rowsOf = (sources) => sources.flatMap(({ direction, power, radiusDeg, exists = 1 }) => [...direction, ...power, radiusDeg, exists]);

for (const name of ["", "whole_"]) {
  test(`the light of ${name ? "a whole photo" : "a cut-out"}`, { skip }, async () => {
    const { picture, longFovDeg } = found;
    const rgba = name ? new Uint8ClampedArray(readFileSync(join(folder, "whole.rgba"))) : picture.rgba;
    const lens = { longFovDeg, isLensKnown: true };
    const { said: byNetwork, radiance, ...rest } = await lightOfStill(found.models, { ...picture, rgba }, lens, floats("mask"), {});
    const light = new Light({ ...describe(radiance, byNetwork), ...rest });
    assertMostlyClose(radiance, floats(`${name}radiance`), 1e-3, "map");
    assertClose(light.confidence, floats(`${name}confidence`), 1e-3, "confidence");
    const said = found.lights[name];
    const { ground, object, uncertainty, hints, dominant } = light;
    const close = (got, wanted, off) => assert.ok(Math.abs(got - wanted) <= off, `${got}, not ${wanted}`);
    close(light.wellExposedFraction, said.well_exposed, 1e-4);
    close(light.soft, said.soft, 1e-4);
    close(light.outdoors, said.outdoors, 1e-3);
    close(dominant.errorDeg, said.error_deg, 0.01);
    assert.ok(light.sources.length > 0);
    assertClose(rowsOf(light.sources), said.sources.flat(), 0.01, "sources");
    close(object.metal, said.metal, 1e-3);
    close(uncertainty.levelStops, said.level_stops, 0.01);
    close(hints.surroundings, said.seen, 1e-4);
    assert.deepEqual([light.isSoft, brightestSide(light)], [said.is_soft, said.side]);
    assert.equal(ground === null, said.ground === null);
    if (ground) assertClose([ground.pitchDeg, ground.pitchErrorDeg, ground.rollDeg, ...ground.contact], said.ground, 1e-3, "ground");
    assert.equal(hints.surroundings > 0.01, name !== "");
    const ofBoth = ["plain-backdrop", "pitch-unsure", "object-dark", "object-clipped", "mirror-ball"];
    assert.deepEqual(light.notices.map(({ code }) => code).sort(), said.codes.filter((code) => ofBoth.includes(code)).sort());
  });
}

test("harmonics and sources of Python's own map", { skip }, () => {
  const light = describe(floats("radiance"));
  assertClose(light.sh9, floats("sh9"), 5e-4, "sh9");
  assertClose(rowsOf(light.sources), floats("sources"), 1e-4, "sources");
});

test("the object that is found from nothing, by clicks, cut along colours, and by a box", { skip }, async () => {
  const { picture } = found;
  const { width, height } = picture;
  assert.deepEqual(Object.keys(found.found), Object.keys(found.hints));
  for (const [name, { iou, doubt }] of Object.entries(found.found)) {
    const { on, off, box = null } = found.hints[name];
    const finding = await findObject(new Looks(new SmallNetwork(found.models), picture), { on, off, box });
    const [mask, expected] = [maskOf(finding, width, height), floats(`mask_${name}`)];
    let [both, either] = [0, 0];
    expected.forEach((value, i) => {
      if (value > 0.5 && mask[i] > 0.5) both++;
      if (value > 0.5 || mask[i] > 0.5) either++;
    });
    assert.ok(either > 0 && both / either >= 0.99, `${name}: IoU ${both / either}`);
    assert.ok(Math.abs(expectedIou(finding) - iou) < 0.01, `${name}: ${expectedIou(finding)}, not ${iou}`);
    assert.equal(doubtOf(finding), doubt);
  }
});

test("the filter of a video's lights", { skip }, () => {
  const frames = floats("frames");
  const size = frames.length / found.frameSeconds.length;
  let state = null;
  found.frameSeconds.forEach((dt, i) => {
    state = step(state, frames.subarray(i * size, (i + 1) * size), dt);
  });
  // how much of a pixel a bright source's edge covers depends on the last bits of its place
  assertMostlyClose(shown(state), floats("steadied"), 1e-3, "steadied");
});

test("a map's discrete sources", { skip }, () => {
  const frames = floats("turning_frames");
  const { rest, sources } = splitSources(frames.subarray(-frames.length / found.frameSeconds.length), 64);
  assert.ok(sources.length > 0);
  assertClose(rowsOf(sources), floats("split_sources"), 1e-4, "sources");
  assertClose(rest, floats("split_soft"), 1e-4, "soft part");
});

test("the filter in the world, of a camera that turns", { skip }, () => {
  const [frames, poses] = [floats("turning_frames"), floats("turning_poses")];
  const size = frames.length / found.frameSeconds.length;
  const poseAt = (i) => [...poses.subarray(9 * i, 9 * i + 9)];
  let state = null;
  found.frameSeconds.forEach((dt, i) => {
    state = step(state, frames.subarray(i * size, (i + 1) * size), dt, poseAt(i));
  });
  assertClose(rowsOf(shownSources(state)), floats("turning_sources"), 1e-4, "sources");
  assertMostlyClose(shown(state), floats("turning_world"), 1e-3, "in the world");
});

test("the leader of sources that change rank", { skip }, () => {
  const [frames, same, counts] = ["led_frames", "led_same", "led_counts"].map(floats);
  const size = frames.length / same.length;
  const rows = [];
  const lengths = [];
  let state = null;
  same.forEach((looksSame, i) => {
    state = step(state, frames.subarray(i * size, (i + 1) * size), 1 / 15, null, Boolean(looksSame));
    if (i % 4 !== 3) return;
    const sources = shownSources(state).filter(({ power }) => power.some((value) => value > 0));
    rows.push(...rowsOf(sources));
    lengths.push(sources.length);
  });
  assert.deepEqual(lengths, [...counts]);
  assertClose(rows, floats("led_sources"), 1e-4, "sources");
});

test("a blur of Python's own map", { skip }, () => {
  assertClose(blurCosinePower(floats("radiance"), 64, 3, 5), floats("blurred"), 1e-4, "blur");
});
