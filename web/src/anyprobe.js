/** The light around an object of one material: pictures and videos in, lights out. */

import { Light } from "./light/light.js";
import { Tracker } from "./live/tracker.js";
import { WorkerClient } from "./networks/workerClient.js";
import { DEFAULT_LONG_FOV_DEG } from "./photo/crop.js";
import { hintsOf } from "./photo/hints.js";
import { givenMaterial, materialInput } from "./photo/material.js";
import { maskFromAlpha } from "./photo/picture.js";
import { readMask, readSource } from "./photo/source.js";

export class AnyProbe {
  #client;
  #tracker = null;

  /** Use load. */
  constructor(client, opened) {
    this.#client = client;
    Object.assign(this, opened);
  }

  /**
   * Open the networks in a thread of their own.
   *
   * @param {import("../types/index.d.ts").LoadOptions} [options]
   * @returns {Promise<AnyProbe>}
   */
  static async load({ engine = "wasm", threads, weights, runtime, onProgress = () => {} } = {}) {
    let given = { weights, runtime };
    if (!weights || !runtime) {
      const { installedRuntime, installedWeights } = await import("./networks/installed.js");
      given = { weights: weights ?? installedWeights(), runtime: runtime ?? installedRuntime(engine) };
    }
    const client = new WorkerClient(onProgress);
    try {
      const most = threads ?? (navigator.hardwareConcurrency || 1);
      return new AnyProbe(client, await client.ask("open", { ...given, engine, threads: most }));
    } catch (error) {
      client.end(); // an engine that did not open once never does
      throw error;
    }
  }

  /**
   * Where the object is: numbers in [0, 1] of the picture's size, or of 1600 pixels along its longer side.
   *
   * @returns {Promise<{mask: Float32Array, width: number, height: number, quality: number | null, warnings: string[]}>}
   *   quality: the IoU to expect, null without a mask network; warnings: a line where that is below 0.81
   */
  async mask(image, hints = {}) {
    const picture = readSource(image);
    return { ...(await this.#findMask(picture, hints)), width: picture.width, height: picture.height };
  }

  /**
   * The light around the object of one picture, in the frame of its camera.
   *
   * @param {import("../types/index.d.ts").ImageSource} image
   * @param {import("../types/index.d.ts").EstimateOptions} [options]
   * @returns {Promise<Light>}
   */
  async estimate(image, { mask, normals, fovDeg = DEFAULT_LONG_FOV_DEG, surroundings, emitters, material, ...hints } = {}) {
    const options = { surroundings, emitters, material: describe(material) };
    const picture = readSource(image);
    const given = mask ? readMask(mask, picture) : maskFromAlpha(picture);
    const found = given ? { mask: given, quality: null, warnings: [] } : await this.#findMask(picture, hints);
    if (normals && normals.length !== 3 * found.mask.length) {
      throw new Error(`normals: expected ${picture.width} x ${picture.height} x 3 numbers, got ${normals.length}`);
    }
    const { light } = await this.examine({ picture, mask: found.mask, normals, longFovDeg: fovDeg, options });
    const { quality, warnings } = found;
    return new Light({ ...light, mask: { quality, warnings } });
  }

  /** estimate for a page that shows the networks' stages and three spheres too; a picture in memory and its mask. */
  async examine(given) {
    const { light, ...views } = await this.#client.ask("estimate", { withViews: true, ...given });
    return { light: new Light(light), ...views };
  }

  /**
   * The light of every frame of a playing video, steady on a still scene; the object is found again as it moves. One video
   * at a time: the last one's tracker is stopped.
   *
   * @param {HTMLVideoElement} video
   * @param {(light: Light, answer: object) => void} onLight
   * @param {import("../types/index.d.ts").TrackOptions} [options]
   * @returns {Tracker}
   */
  track(video, onLight, { fovDeg = DEFAULT_LONG_FOV_DEG, surroundings, emitters, material, onError, onLost, withViews = false, ...hints } = {}) {
    const options = { surroundings, emitters, material: describe(material) };
    this.#tracker?.stop();
    const tracker = (this.#tracker = new Tracker(video, this.#client, {
      onLight: (answer) => (answer.lost ? onLost?.(answer) : onLight(answer.light, answer)),
      onError: onError ?? reportError,
    }));
    const given = { hints, longFovDeg: fovDeg, options, withViews };
    tracker.start(given).catch((error) => tracker.running && tracker.onError(error));
    return tracker;
  }

  /** End the thread; what is asked of it still is refused. */
  dispose() {
    this.#tracker?.stop();
    this.#client.end();
  }

  #findMask(picture, hints) {
    return this.#client.ask("mask", { picture, hints: hintsOf(hints, picture.scale) });
  }
}

/** A given material as the network takes it. */
const describe = (material) => (material === undefined ? undefined : materialInput(givenMaterial(material)));
