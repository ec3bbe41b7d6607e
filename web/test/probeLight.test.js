/** The light in a scene: counted once, whichever environment the scene has. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { Group, PerspectiveCamera, Scene } from "three";

import { irradiance } from "../src/light/harmonics.js";
import { describe } from "../src/light/light.js";
import { pixelDirections, pixelSolidAngles } from "../src/core/latlong.js";
import { rotationOfPose } from "../src/options.js";
import { EnvironmentTexture, ProbeLight } from "../src/three/index.js";

const TO_LIGHT = [0.6, 0.8, 0];

/** An even light of 0.2 with a source of 5 degrees. */
function mapOf() {
  const directions = pixelDirections(64);
  const radiance = new Float32Array(directions.length).fill(0.2);
  for (let at = 0; at < radiance.length; at += 3) {
    const cosine = directions[at] * TO_LIGHT[0] + directions[at + 1] * TO_LIGHT[1] + directions[at + 2] * TO_LIGHT[2];
    if (cosine > Math.cos((5 * Math.PI) / 180)) radiance.fill(100, at, at + 3);
  }
  return describe(radiance);
}

/** Irradiance that a scene's lights give a plane, without its environment. */
function ofLights({ lightProbe, directionalLight }, normal) {
  const direction = directionalLight.position.clone().normalize().toArray();
  const cosine = Math.max(direction.reduce((sum, value, i) => sum + value * normal[i], 0), 0);
  const [rest] = irradiance(lightProbe.sh.toArray(), normal);
  return lightProbe.intensity * rest + directionalLight.intensity * directionalLight.color.r * cosine;
}

/** The map's irradiance, pixel by pixel. */
function summed(radiance, normal) {
  const [directions, angles] = [pixelDirections(64), pixelSolidAngles(64)];
  let sum = 0;
  for (let at = 0; at < radiance.length; at += 3) {
    const cosine = normal.reduce((total, value, i) => total + value * directions[at + i], 0);
    sum += Math.max(cosine, 0) * radiance[at] * angles[Math.floor(at / 384)];
  }
  return sum;
}

test("a scene without an environment has its dark side lit, and the whole light once", () => {
  const light = mapOf();
  const lights = new ProbeLight(null);
  const scene = new Scene().add(lights);
  scene.updateMatrixWorld();
  assert.equal(lights.lightProbe.intensity, 0, "no light before the first estimate");
  lights.update(light);
  scene.updateMatrixWorld();
  for (const normal of [TO_LIGHT, TO_LIGHT.map((value) => -value)]) {
    const whole = summed(light.radiance, normal);
    assert.ok(Math.abs(ofLights(lights, normal) - whole) < 0.02 * whole, `${normal}: ${ofLights(lights, normal)}, not ${whole}`);
  }
  scene.environment = lights.environment;
  scene.updateMatrixWorld();
  assert.equal(lights.lightProbe.intensity, 0, "the rest is the environment's");
  scene.environment = null;
  scene.updateMatrixWorld();
  assert.equal(lights.lightProbe.intensity, 1);
});

test("a camera under a scaled group turns the light as one that is not", () => {
  const asked = [];
  const lights = new ProbeLight({ track: (source, onLight, { pose }) => ({ stop: () => {}, pose }) });
  for (const scale of [1, 0.01]) {
    const camera = new PerspectiveCamera();
    camera.rotation.set(0.2, 0.7, 0);
    const group = new Group().add(camera);
    group.scale.setScalar(scale);
    group.updateMatrixWorld(true);
    asked.push(rotationOfPose(lights.track(null, { camera }).pose()));
  }
  asked[0].forEach((value, i) => assert.ok(Math.abs(value - asked[1][i]) < 1e-6));
});

test("a scene that holds the whole light too is warned of, once", () => {
  const light = mapOf();
  const lights = new ProbeLight(null);
  const scene = new Scene().add(lights);
  lights.update(light);
  const { warn } = console;
  const said = [];
  try {
    console.warn = (line) => said.push(line);
    scene.environment = lights.environment;
    scene.updateMatrixWorld();
    assert.deepEqual(said, []);
    scene.environment = new EnvironmentTexture().update(light.prefiltered);
    for (let i = 0; i < 3; i++) scene.updateMatrixWorld();
  } finally {
    console.warn = warn;
  }
  assert.equal(said.length, 1);
  assert.match(said[0], /count twice; set scene\.environment = probeLight\.environment/);
});
