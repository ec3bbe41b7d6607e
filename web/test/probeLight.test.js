/** The light in a scene: counted once, whichever environment the scene has. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { Group, Object3D, PerspectiveCamera, Scene } from "three";

import { irradiance } from "../src/light/harmonics.js";
import { Light, describe } from "../src/light/light.js";
import { pixelDirections, pixelSolidAngles } from "../src/core/latlong.js";
import { rotationOfPose } from "../src/live/pose.js";
import { EnvironmentTexture, PhotoGround, ProbeLight } from "../src/three/index.js";

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

/** A session whose camera looks along -X from 1 above the floor, with pictures of 640 x 480. */
function session() {
  const camera = new PerspectiveCamera(45, 4 / 3);
  camera.position.set(0, 1, 0);
  camera.rotation.y = Math.PI / 2;
  camera.updateMatrixWorld(true);
  const [matrix, inverse] = [camera.matrixWorld.elements, camera.matrixWorldInverse.elements];
  const view = { camera: { width: 640, height: 480 }, projectionMatrix: camera.projectionMatrix.elements, transform: { matrix, inverse: { matrix: inverse } } };
  const xr = { getReferenceSpace: () => null, getBinding: () => ({ getCameraImage: () => ({}) }) };
  return { renderer: { xr, getContext: () => ({}) }, frame: { getViewerPose: () => ({ views: [view] }) }, camera };
}

/** A probe whose trackers fail at their first frame, or never. */
function probeOf(fails) {
  const asked = { tracked: 0, offered: 0, marks: [], errors: [] };
  const track = (source, onLight, { onLost }) => {
    asked.tracked++;
    const tracker = {
      running: true,
      stop: () => (tracker.running = false),
      offer: async () => {
        asked.offered++;
        if (fails) throw new Error("wrong");
      },
      fail: (error) => {
        if (tracker.running) asked.errors.push(error.message);
        tracker.running = false;
      },
      mark: async (hints) => void asked.marks.push(hints),
    };
    return Object.assign(asked, { onLight, onLost }) && tracker;
  };
  return { asked, track };
}

test("what fails in a session is said once, until it is begun anew", async () => {
  const [{ renderer, frame }, probe] = [session(), probeOf(true)];
  const lights = new ProbeLight(probe);
  for (let at = 0; at < 5; at++) {
    assert.equal(lights.offerCamera(renderer, frame), true);
    await new Promise((resolve) => setTimeout(resolve));
  }
  assert.deepEqual([probe.asked.tracked, probe.asked.errors], [1, ["wrong"]]);
  lights.stop();
  lights.offerCamera(renderer, frame);
  assert.equal(probe.asked.tracked, 2);
  probe.track = () => {
    throw new Error("unknown option");
  };
  lights.stop();
  assert.throws(() => lights.offerCamera(renderer, frame), /unknown option/);
  assert.equal(lights.offerCamera(renderer, frame), true);
});

test("a tap in a session marks what its ray points at", async () => {
  const [{ renderer, frame, camera }, probe] = [session(), probeOf(false)];
  const lights = new ProbeLight(probe);
  const controller = new Object3D();
  await assert.rejects(lights.mark(controller), { code: "invalid-option" });
  lights.offerCamera(renderer, frame);
  controller.position.copy(camera.position);
  controller.rotation.copy(camera.rotation);
  controller.rotateY(-0.1); // to the right
  controller.updateMatrixWorld(true);
  await lights.mark(controller);
  const [[x, y]] = probe.asked.marks.map(({ click }) => click);
  const focal = 240 / Math.tan((22.5 * Math.PI) / 180);
  assert.ok(Math.abs(x - 320 - focal * Math.tan(0.1)) < 1e-3 && Math.abs(y - 240) < 1e-3, `${x}, ${y}`);
});

test("until an object is seen the light is even, of the picture's mean colour", () => {
  const [{ renderer, frame }, probe] = [session(), probeOf(false)];
  const lights = new ProbeLight(probe);
  const started = [];
  lights.addEventListener("estimationstart", () => started.push(lights.estimate.radiance[0]));
  lights.offerCamera(renderer, frame);
  probe.asked.onLost({ lost: true, mean: [0.25, 0.5, 0.75] });
  assert.deepEqual([...lights.estimate.radiance.subarray(0, 3)], [0.25, 0.5, 0.75]);
  assert.ok(lights.directionalLight.intensity < 1e-3);
  const light = new Light(mapOf());
  probe.asked.onLight(light);
  probe.asked.onLost({ lost: true, mean: [1, 1, 1] });
  assert.equal(lights.estimate, light, "an object that is lost keeps its light");
  assert.deepEqual(started, [0.25]);
});

test("the camera of a light has its lens", () => {
  const mask = { width: 640, height: 480 };
  const { fov, aspect } = PhotoGround.camera({ mask, lens: { longFovDeg: 60 } });
  assert.ok(Math.abs(fov - 46.83) < 0.01 && Math.abs(aspect - 4 / 3) < 1e-9);
  assert.throws(() => PhotoGround.camera({ mask }), { code: "invalid-option" });
});
