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

import { cameraRadiance, describe } from "../src/light/light.js";
import { irradianceMap, blurCosinePower } from "../src/light/filtering.js";
import { splitSources } from "../src/light/sourceSplit.js";
import { shown, shownSources, step } from "../src/light/temporal.js";
import { isCutOut } from "../src/photo/backdrop.js";
import { contextOf, cropNormals, cropObject } from "../src/photo/crop.js";
import { givenMaterial, materialInput } from "../src/photo/material.js";
import { lookAtGiven } from "../src/photo/maskCheck.js";
import { groundDoubts } from "../src/photo/ground.js";
import { objectBox } from "../src/photo/picture.js";
import { readMask } from "../src/photo/source.js";
import { seeSurroundings, withoutTransparent } from "../src/photo/surroundings.js";
import { SmallNetwork } from "../src/photo/maskNetworks.js";
import { doubts, examine, expectedIou } from "../src/photo/quality.js";
import { Looks, findObject, maskOf } from "../src/photo/search.js";
import { lightOfObject } from "../src/networks/lightOfObject.js";
import { inverseResponse, response } from "../src/core/response.js";
import { Silhouette, farthestRow, findSpot } from "../page/view/placement.js";
import { lightOfStill } from "../src/networks/lightOfStill.js";
import { Models } from "../src/networks/models.js";
import { leastMetal } from "../src/photo/mirrorBall.js";

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
  Object.assign(found, { picture: { width, height, rgba }, longFovDeg: long_fov_deg, hints: given.hints, materials: given.materials, frameSeconds: given.frame_seconds, placements: given.placements, groundDoubts: given.ground_doubts, balls: given.balls, givenMasks: given.given_masks, found: given.found });
  found.crop = cropObject(found.picture, floats("mask"), long_fov_deg);
  ort.env.wasm.numThreads = 1;
  const bytes = Object.fromEntries(
    Object.entries(weights).map(([stage, path]) => [stage, new Uint8Array(readFileSync(path))]),
  );
  found.models = await Models.open(ort, bytes);
  found.stages = await found.models.light(found.crop.image, found.crop.tanHalf);
  const { expected } = found.stages;
  found.likely = expected ? { expected, cameraFromCrop: found.crop.cameraFromCrop } : null;
  found.light = describe(cameraRadiance(found.stages, found.crop.cameraFromCrop), found.likely);
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

test("a soft mask from a picture of it, and the light with it", { skip }, async () => {
  const { picture, longFovDeg, models } = found;
  globalThis.ImageData = class {
    constructor(data, width, height) {
      Object.assign(this, { data, width, height });
    }
  };
  const { width, height } = picture;
  const file = new ImageData(new Uint8ClampedArray(readFileSync(join(folder, "mask_file.rgba"))), width, height);
  const mask = await readMask(file, { width, height, fullWidth: width, fullHeight: height });
  assertClose(mask, floats("mask_soft"), 1e-5, "soft mask");
  const crop = cropObject(picture, mask, longFovDeg);
  const { radiance } = await lightOfObject(models, picture, longFovDeg, crop, {});
  assertMostlyClose(radiance, floats("radiance_soft"), 3e-3, "radiance of the soft mask");
  assertClose(describe(radiance).sh9, floats("sh9_soft"), 1e-3, "sh9 of the soft mask");
});

/** The light of the photo's object by other options. */
const lit = (options) => lightOfObject(found.models, found.picture, found.longFovDeg, found.crop, options);

test("the background, and the map with it", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain has no use for it");
  const { crop, picture } = found;
  assertClose(seeSurroundings(picture, found.longFovDeg, crop), floats("surroundings"), 2e-3, "surroundings");
  const { radiance, stages, confidence } = await lit({ surroundings: true });
  assertMostlyClose(radiance, floats("radiance_surroundings"), 3e-3, "radiance with surroundings");
  assertMostlyClose(confidence, floats("confidence_surroundings"), 3e-3, "confidence with surroundings");
  assertMostlyClose(stages.ldr, stages.radiance.map((value) => response(value)), 1e-6, "ldr with surroundings");
});

test("a cut-out is lit as its object alone", { skip }, async () => {
  assert.ok(isCutOut(found.picture, found.crop.mask));
  const { radiance, hints } = await lit({});
  assert.equal(hints.surroundings, 0);
  assertMostlyClose(radiance, floats("radiance"), 3e-3, "radiance of the object alone");
});

test("what stands around the object, the camera's pitch, and the map with them", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain has no use for it");
  const { longFovDeg, crop, models } = found;
  const picture = { ...found.picture, rgba: found.picture.rgba.map((value, i) => (i % 4 === 3 ? 255 : value)) };
  assert.ok(!isCutOut(picture, crop.mask));
  assertClose(contextOf(picture, crop.mask, crop), floats("context"), 1e-5, "context");
  for (const [name, pitchDeg] of [["auto", undefined], ["auto_pitch", 35]]) {
    const { radiance, confidence, ground } = await lightOfObject(models, picture, longFovDeg, crop, { pitchDeg });
    assertClose([ground.pitchDeg, ground.pitchErrorDeg, ground.rollDeg, ...ground.contact], floats(`ground_${name}`), 0.05, `ground, ${name}`);
    assertMostlyClose(radiance, floats(`radiance_${name}`), 5e-3, `radiance, ${name}`);
    assertMostlyClose(confidence, floats(`confidence_${name}`), 3e-3, `confidence, ${name}`);
  }
});

test("transparent pixels are no surroundings", { skip }, (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain has no use for it");
  const { longFovDeg, crop } = found;
  const transparent = floats("transparent");
  const rgba = found.picture.rgba.map((value, i) => (i % 4 === 3 ? 255 * (1 - transparent[(i - 3) / 4]) : value));
  const { picture, opaque } = withoutTransparent({ ...found.picture, rgba });
  assertClose(seeSurroundings(picture, longFovDeg, crop, opaque), floats("surroundings_transparent"), 2e-3, "surroundings");
  assertClose(contextOf(picture, crop.mask, crop, opaque), floats("context_transparent"), 1e-5, "context");
  const whole = { ...found.picture, rgba: found.picture.rgba.map((value, i) => (i % 4 === 3 ? 255 : value)) };
  assert.deepEqual(withoutTransparent(whole), { picture: whole, opaque: null });
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

test("the mean radiance of light sources", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain knows their likeliest positions alone");
  const { radiance, stages } = await lit({ emitters: "expected" });
  assertMostlyClose(radiance, floats("radiance_expected"), 3e-3, "radiance expected");
  assertMostlyClose(stages.ldr, stages.radiance.map((value) => response(value)), 1e-6, "ldr expected");
});

test("a second look in a mirror", { skip }, async (t) => {
  if (!found.models.lifts) return assert.rejects(lit({ looks: 2 }), ({ notice }) => notice.code === "invalid-option" && notice.subject[0] === "looks");
  const normals = cropNormals(floats("normals"), floats("mask"), found.picture.width, found.crop);
  const cases = { radiance_looks: {}, radiance_looks_auto: { surroundings: true, isAlone: false, pitchDeg: 35 }, radiance_looks_normals: { normals } };
  for (const [name, given] of Object.entries(cases)) assertMostlyClose((await lit({ ...given, looks: 2 })).radiance, floats(name), 5e-3, name);
});

test("given normals, cropped, and the map with them", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain has no use for them");
  const normals = cropNormals(floats("normals"), floats("mask"), found.picture.width, found.crop);
  assertClose(normals, floats("normals_crop"), 1e-4, "normals");
  assertMostlyClose((await lit({ normals })).radiance, floats("radiance_normals"), 3e-3, "radiance with normals");
});

test("a given material, and the map with it", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain has no use for it");
  for (const [name, given] of Object.entries(found.materials)) {
    const material = materialInput(givenMaterial(given));
    assertClose(material, floats(`material_${name}`), 1e-6, name);
    assertMostlyClose((await lit({ material })).radiance, floats(`radiance_${name}`), 5e-3, `radiance of ${name}`);
  }
});

test("what it says of its own map's level and colour", { skip }, async (t) => {
  if (!found.models.lifts) return t.diagnostic("the paper's chain says nothing");
  const { levelStops, colorDeg } = (await lit({})).uncertainty;
  assertClose([levelStops, colorDeg], floats("uncertainty"), 0.02, "uncertainty");
});

test("the confidence, its mean, and how much of the object is well exposed", { skip }, async (t) => {
  const { confidence, meanConfidence, wellExposedFraction } = await lit({});
  if (!found.models.lifts) {
    assert.equal(confidence, null);
    return t.diagnostic("the paper's chain has none");
  }
  assertMostlyClose(confidence, floats("confidence"), 3e-3, "confidence");
  assertClose([meanConfidence, wellExposedFraction], floats("exposure"), 2e-3, "exposure");
});

test("the camera's curve and its inverse", { skip }, () => {
  const steps = Float32Array.from({ length: 256 }, (_, i) => i / 200);
  assertClose(steps.map(response), floats("curve"), 1e-6, "curve");
  assertClose(steps.map(inverseResponse), floats("curve_inverse"), 1e-6, "inverse");
});

test("a backdrop's smooth shading is no place, planks are one", { skip }, () => {
  const { crop, picture } = found;
  const shaded = (planks) => {
    const rgba = new Uint8ClampedArray(picture.rgba.length).fill(255);
    for (let pixel = 0; pixel < rgba.length / 4; pixel++) {
      const [x, y] = [pixel % picture.width, Math.floor(pixel / picture.width)];
      const value = 90 + (70 * y) / picture.height - (planks && Math.floor(x / 24) % 2 ? 20 : 0);
      rgba.fill(value, 4 * pixel, 4 * pixel + 3);
    }
    return { ...picture, rgba };
  };
  assert.ok(isCutOut(shaded(false), crop.mask));
  assert.ok(!isCutOut(shaded(true), crop.mask));
});

test("one colour behind the object is no place", { skip }, () => {
  const { crop, picture } = found;
  const plain = { ...picture, rgba: new Uint8ClampedArray(picture.rgba.length).fill(200) };
  assert.equal(seeSurroundings(plain, found.longFovDeg, crop), null);
});

test("harmonics and dominant light of Python's own map", { skip }, () => {
  const light = describe(floats("radiance"), found.likely);
  assertClose(light.sh9, floats("sh9"), 1e-5, "sh9");
  const { direction, irradiance, color, solidAngle, directionality, errorDeg } = light.dominant;
  const main = [...direction, ...irradiance, ...color, solidAngle, directionality, errorDeg / 90];
  assertClose(main, floats("dominant_light"), 1e-4, "dominant light");
});

test("the object that is found from nothing, by clicks, cut along colours, and by a box", { skip }, async () => {
  const { picture } = found;
  const { width, height } = picture;
  assert.deepEqual(Object.keys(found.found), Object.keys(found.hints));
  for (const [name, { iou, doubts: lines, ...evidence }] of Object.entries(found.found)) {
    const { on, off, box = null } = found.hints[name];
    const finding = await findObject(new Looks(new SmallNetwork(found.models), picture), { on, off, box });
    const [mask, expected] = [maskOf(finding, width, height), floats(`mask_${name}`)];
    let [both, either] = [0, 0];
    expected.forEach((value, i) => {
      if (value > 0.5 && mask[i] > 0.5) both++;
      if (value > 0.5 || mask[i] > 0.5) either++;
    });
    assert.ok(either > 0 && both / either >= 0.99, `${name}: IoU ${both / either}`);
    const seen = examine(finding, width, height, { on, off, box });
    for (const [key, value] of Object.entries(evidence)) {
      assert.ok(Math.abs(seen[key] - value) < 0.01, `${name} ${key}: ${seen[key]}, not ${value}`);
    }
    assert.ok(Math.abs(expectedIou(seen, "small") - iou) < 0.01, `${name}: ${expectedIou(seen, "small")}, not ${iou}`);
    assert.deepEqual(doubts(seen), lines);
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
  assertClose(shown(state), floats("steadied"), 1e-3, "steadied");
});

const rowsOf = (sources) => sources.flatMap(({ direction, power, radius }) => [...direction, ...power, radius]);

test("a map's discrete sources", { skip }, () => {
  const frames = floats("turning_frames");
  const { soft, sources } = splitSources(frames.subarray(-frames.length / found.frameSeconds.length), 64);
  assert.ok(sources.length > 0);
  assertClose(rowsOf(sources), floats("split_sources"), 1e-4, "sources");
  assertClose(soft, floats("split_soft"), 1e-4, "soft part");
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
  assertMostlyClose(shown(state, poseAt(found.frameSeconds.length - 1)), floats("turning_camera"), 1e-3, "in the camera");
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

test("blurs of Python's own map", { skip }, () => {
  assertClose(irradianceMap(floats("radiance"), 64), floats("irradiance_map"), 1e-4, "irradiance map");
  assertClose(blurCosinePower(floats("radiance"), 64, 3, 5), floats("blurred"), 1e-4, "blur");
});

test("where a virtual object stands", { skip }, () => {
  const sides = { beside: 0, front: 0, behind: 0 };
  const atFarRow = found.placements.filter(({ shape, row, behind, most_behind: mostBehind, card, pitch_deg: pitchDeg, found: expected }) => {
    const mask = new Float32Array(600 * 400);
    for (const [x0, y0, x1, y1] of shape) {
      for (let y = y0; y < y1; y++) mask.fill(1, y * 600 + x0, y * 600 + x1);
    }
    const silhouette = new Silhouette(mask, 600, objectBox(mask, 600));
    const extentAt = ({ x, y, share }) => {
      const scale = share * Math.max(0.5 + (0.5 * y) / 400, 0.1);
      return [x - (card[0] * scale) / 2, y - card[1] * scale, x + (card[0] * scale) / 2, y + 0.3 * card[1] * scale];
    };
    const farRow = farthestRow(400, 500, pitchDeg);
    const spot = findSpot({ silhouette, row, behind, farRow, mostBehind }, extentAt);
    assertClose([spot.x, spot.y, spot.share], [expected.x, expected.y, expected.share], 1e-6, `${shape} ${card} ${pitchDeg}`);
    assert.equal(spot.side, expected.side);
    sides[spot.side] += 1;
    return Math.abs(spot.y - farRow) < 1e-9;
  });
  assert.ok(atFarRow.length > 3);
  assert.ok(Math.min(...Object.values(sides)) > 3, JSON.stringify(sides));
});

test("which balls are mirrors, and the light that these show", { skip }, async () => {
  for (const [at, { width, height, long_fov_deg: longFovDeg, is_known: isLensKnown, least_metal: least, is_ball: isBall }] of found.balls.entries()) {
    const picture = { width, height, rgba: new Uint8ClampedArray(readFileSync(join(folder, `ball_${at}.rgba`))) };
    const mask = floats(`ball_${at}_mask`);
    const metal = leastMetal(picture, mask, longFovDeg, isLensKnown);
    assert.equal(metal === Infinity ? -1 : metal, least, `${at}`);
    const light = await lightOfStill(found.models, picture, { longFovDeg, isLensKnown }, cropObject(picture, mask, longFovDeg), {});
    assert.equal(light.warnings.some(({ code }) => code === "mirror-ball"), isBall, `${at}`);
    assertMostlyClose(light.radiance, floats(`ball_${at}_radiance`), 5e-3, `${at} radiance`);
    assertMostlyClose(light.confidence, floats(`ball_${at}_confidence`), 2e-3, `${at} confidence`);
    const given = await lightOfStill(found.models, picture, { longFovDeg, isLensKnown }, cropObject(picture, mask, longFovDeg), { material: materialInput(givenMaterial("matte")) });
    assert.ok(!given.warnings.some(({ code }) => code === "mirror-ball"));
  }
});
