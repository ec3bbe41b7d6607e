/** The estimate as lights of three.js; replaces XREstimatedLight. */

import { DirectionalLight, Group, LightProbe, Matrix4, Vector3 } from "three";
import { AnyProbeError } from "../errors.js";
import { MAP_HEIGHT } from "../core/latlong.js";
import { rotate } from "../light/environment.js";
import { Light, describe } from "../light/light.js";
import { checkIsLight } from "../light/groundShadow.js";
import { project } from "../light/harmonics.js";
import { prefilter } from "../light/prefilter.js";
import { NO_SOURCE, splitDominantLight } from "../light/lightSources.js";
import { wrong } from "../checks.js";
import { EnvironmentTexture } from "./environmentTexture.js";

/** Of the directional light from the group's place: its shadow camera reaches from 0.5 to 500, 5 to each side. */
const DISTANCE = 5;

/** Along a controller's ray, where what is tapped on is taken to be, metres: on a phone each place of it is at one pixel. */
const RAY = 2;

/**
 * `lightProbe`, `directionalLight` and `environment` as XREstimatedLight has them, and its events `estimationstart` and
 * `estimationend`. Together they give the whole light once: the directional light is the dominant one, and the rest is the
 * environment in a scene that has it as its own, in any other the light probe.
 */
export class ProbeLight extends Group {
  #tracker = null;
  #texture = null;
  #hasStarted = false;
  #hasWarned = false;
  #isBlind = false; // the session's views have no camera, and that was said
  #view = null; // of the session's camera, when its picture was offered last
  #isFallback = true; // no object has been seen yet

  constructor(probe, environmentEstimation = true) {
    super();
    this.probe = probe;
    this.lightProbe = new LightProbe();
    this.lightProbe.intensity = 0;
    this.directionalLight = new DirectionalLight();
    this.directionalLight.intensity = 0;
    this.add(this.lightProbe, this.directionalLight, this.directionalLight.target); // shadows fall around its place
    this.#texture = environmentEstimation ? new EnvironmentTexture() : null;
    this.environment = this.#texture?.texture ?? null;
    if (this.environment) this.environment.userData.isWholeLight = false;
    this.estimate = null;
  }

  /** Take on a light. */
  update(light, camera = null) {
    checkIsLight(light);
    this.estimate = light;
    this.#isFallback = false;
    const isTurned = camera && !light.isInWorld;
    const radiance = isTurned ? rotate(light.radiance, MAP_HEIGHT, rotationOf(camera)) : light.radiance;
    const { rest, sources: [dominant = NO_SOURCE] } = splitDominantLight(radiance, MAP_HEIGHT);
    this.lightProbe.sh.fromArray(project(rest, MAP_HEIGHT));
    this.#texture?.update(prefilter(rest));
    this.directionalLight.color.setRGB(...dominant.color);
    this.directionalLight.intensity = Math.max(...dominant.irradiance);
    this.directionalLight.position.set(...dominant.direction).multiplyScalar(DISTANCE);
    if (this.#hasStarted) return;
    this.#hasStarted = true;
    this.dispatchEvent({ type: "estimationstart" });
  }

  /** Before every picture: what gives the rest of the light in this scene, whatever it was given since the last one. */
  updateMatrixWorld(force) {
    let scene = this.parent;
    while (scene && !scene.isScene) scene = scene.parent;
    const { environment } = scene ?? {};
    const isLit = this.estimate !== null && (!environment || environment !== this.environment);
    this.lightProbe.intensity = isLit ? 1 : 0;
    if (environment?.userData.isWholeLight && this.directionalLight.intensity > 0 && !this.#hasWarned) {
      this.#hasWarned = true;
      console.warn("ProbeLight: scene.environment holds the whole light too, so that the dominant light and the rest count twice; set scene.environment = probeLight.environment");
    }
    super.updateMatrixWorld(force);
  }

  /** Follow the light of a source until stop; again after that, as for the next XR session. */
  track(source, { camera = null, ...options } = {}) {
    this.stop();
    if (!this.probe?.track) throw wrong("probe", "what AnyProbe.load gives, as ProbeLight's first argument", this.probe);
    const pose = camera ? { pose: () => new Matrix4().extractRotation(camera.matrixWorld) } : {};
    const onLost = (answer) => {
      if (this.#isFallback && answer.mean) this.#updateEven(answer.mean);
      options.onLost?.(answer);
    };
    this.#tracker = this.probe.track(source, (light) => this.update(light), { ...pose, ...options, onLost });
    return this.#tracker;
  }

  /** Until an object is seen: an even light of the picture's mean colour. */
  #updateEven(mean) {
    const radiance = Float32Array.from({ length: 6 * MAP_HEIGHT * MAP_HEIGHT }, (_, i) => mean[i % 3]);
    this.update(new Light({ ...describe(radiance), isInWorld: true }));
    this.#isFallback = true;
  }

  /**
   * In an XR session's animation loop: follow the light of the camera whose picture the session shows, by the pose of its view.
   * The session must have been asked for with requiredFeatures: ["camera-access"].
   */
  offerCamera(renderer, frame, options = {}) {
    const views = frame?.getViewerPose(renderer.xr.getReferenceSpace())?.views ?? [];
    const view = views.find(({ camera }) => camera);
    if (views.length > 0 && !view && !this.#isBlind) {
      this.#isBlind = true;
      console.warn('ProbeLight: the session has no camera picture; ask for it with requiredFeatures: ["camera-access"], on a device and browser that give it');
    }
    if (!view) return false;
    const { width, height } = view.camera;
    if (!this.#tracker) this.#begin({ projectionMatrix: view.projectionMatrix, ...options });
    const [clip, world] = [view.projectionMatrix, view.transform.inverse.matrix].map((numbers) => new Matrix4().fromArray(numbers));
    this.#view = { clip: clip.multiply(world), width, height };
    const tracker = this.#tracker;
    if (!tracker.running) return true; // it has failed, which was said
    const texture = renderer.xr.getBinding().getCameraImage(view.camera);
    tracker.offer({ gl: renderer.getContext(), texture, width, height }, { pose: view.transform }).catch((error) => tracker.fail(error));
    return true;
  }

  /** Throw an error once, not in each frame. */
  #begin(options) {
    try {
      this.track(null, options);
    } catch (error) {
      this.#tracker = { running: false, stop: () => {} };
      throw error;
    }
  }

  /** The object that is the probe, by a tap in the session. */
  async mark(controller) {
    if (!this.#view || !this.#tracker) throw new AnyProbeError("invalid-option", "expected a picture of the session's camera first; call offerCamera at each frame");
    const { clip, width, height } = this.#view;
    const { x, y } = new Vector3(0, 0, -RAY).applyMatrix4(controller.matrixWorld).applyMatrix4(clip);
    await this.#tracker.mark({ click: [((x + 1) / 2) * width, ((1 - y) / 2) * height] });
  }

  stop() {
    this.#tracker?.stop();
    this.#tracker = this.#view = null;
    this.#isBlind = false;
    this.#isFallback = true;
    if (this.#hasStarted) this.dispatchEvent({ type: "estimationend" });
    this.#hasStarted = false;
  }

  /** Free GPU memory; the probe stays open. */
  dispose() {
    this.stop();
    this.remove(this.lightProbe, this.directionalLight, this.directionalLight.target);
    this.directionalLight.dispose();
    this.environment?.dispose();
    this.environment = null;
  }
}

/** The rotation of an object's matrixWorld, nine numbers row by row. */
function rotationOf({ matrixWorld }) {
  const m = new Matrix4().extractRotation(matrixWorld).elements;
  return [m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]];
}
