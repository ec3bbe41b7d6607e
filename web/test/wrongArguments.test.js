/** What is given to helpers and three.js's parts is checked: whatever goes wrong is an AnyProbeError. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { OrthographicCamera, PerspectiveCamera } from "three";

import { Light, groundShadowOpacity, irradiance } from "../src/exports.js";
import { describe } from "../src/light/light.js";
import { EnvironmentTexture, MaskOccluder, PhotoGround, ProbeLight } from "../src/three/index.js";

const refused = (message) => ({ name: "AnyProbeError", code: "invalid-option", message });
const light = describe(new Float32Array(3 * 64 * 128).fill(0.5));

test("harmonics, normals and lights that are none are refused", () => {
  assert.throws(() => irradiance(new Float32Array(9), [0, 1, 0]), refused("sh9: expected 27 numbers, such as light.sh9, got 9"));
  assert.throws(() => irradiance(light.sh9, [0, 10, 0]), refused("normal: expected [x, y, z] of length 1, got [0, 10, 0]"));
  assert.throws(() => irradiance(light.sh9, { x: 0, y: 1, z: 0 }), refused("normal: expected [x, y, z] of length 1, got object"));
  assert.ok(irradiance(light.sh9, [0, 0.6, 0.8])[0] > 0);
  for (const nothing of [undefined, null, {}]) {
    assert.throws(() => groundShadowOpacity(nothing, [0, 1, 0]), refused(/^light: expected one of probe\.estimate, got /));
    assert.throws(() => new ProbeLight().update(nothing), refused(/^light: expected one/));
  }
  assert.throws(() => groundShadowOpacity(light), refused("normal: expected [x, y, z] of length 1, got undefined"));
  assert.throws(() => new ProbeLight().track(null), refused(/^probe: expected what AnyProbe\.load gives, .* got undefined/));
  assert.throws(() => new EnvironmentTexture().update(light.radiance), refused(/^levels: expected light\.prefiltered/));
  new EnvironmentTexture().update(light.prefiltered);
});

test("a light that was sent or stored has its environment again", () => {
  const made = new Light({ ...light, warnings: ["doubtful"] });
  const copy = structuredClone(made);
  assert.equal(copy.environment, undefined);
  assert.deepEqual(new Light(copy), made);
  assert.deepEqual(new Light(copy).environment, made.environment);
});

test("a ground and an occluder are told what they cannot use", () => {
  const [width, height] = [40, 30];
  const data = Float32Array.from({ length: width * height }, (_, i) => (i % width > 10 && i % width < 30 && i > 5 * width && i < 25 * width ? 1 : 0));
  const seen = { ...light, mask: { data, width, height }, ground: { pitchDeg: 16 } };
  const camera = new PerspectiveCamera(40, width / height);
  assert.equal(new PhotoGround(seen, camera).pitchDeg, 16);
  for (const [options, message] of [
    [{ pitch: 30 }, /^PhotoGround: unknown option pitch; expected of pitchDeg/],
    [{ pitchDeg: "20" }, /^pitchDeg: expected -90 to 90 degrees/],
    [null, /^PhotoGround: expected an object of options, got null/],
  ]) {
    assert.throws(() => new PhotoGround(seen, camera, options), refused(message));
  }
  assert.throws(() => new PhotoGround(seen, new OrthographicCamera()), refused("camera: expected a PerspectiveCamera, got OrthographicCamera"));
  assert.throws(() => new PhotoGround(undefined, camera), refused(/^light: expected one with the mask/));
  const occluder = new MaskOccluder();
  assert.throws(() => occluder.show({ data: data.subarray(9), width, height }, 5, 30), refused(/^mask: .* got 1191 of 40 x 30$/));
  assert.throws(() => occluder.show(null, 5, 30), refused(/^mask: /));
  assert.throws(() => occluder.show(seen.mask, NaN, 30), refused(/^distance and focalPx: expected numbers above 0, got NaN and 30/));
  occluder.show(seen.mask, 5, 30);
});
