/** Every frame of a video to the networks' thread, which takes the newest, and the lights that come back. */

import { receivedError } from "../errors.js";
import { Light } from "../light/light.js";
import { checkHints, checkLight, checkNames, longFovOf } from "../options.js";
import { hintsOf } from "../photo/hints.js";
import { takeFrame } from "./videoFrames.js";

/** Rates are means over this many seconds. */
const WINDOW_S = 2;

export class Tracker {
  /**
   * @param {HTMLVideoElement} video playing
   * @param {import("../networks/workerClient.js").WorkerClient} client
   * @param {{onLight: (answer: object) => void, onError: (error: Error) => void}} events
   */
  constructor(video, client, { onLight, onError }) {
    Object.assign(this, { video, client, onLight, onError });
    this.running = false;
    this.mask = null; // the last one found
    this.updates = [];
    this.frames = [];
  }

  /** @param {{hints: object, lens: object, options: object, withViews: boolean}} given hints as of mark */
  async start({ hints, lens, ...given }) {
    this.running = true;
    const longFovDeg = longFovOf(lens, this.video.videoWidth, this.video.videoHeight);
    await this.client.ask("startLive", { ...given, longFovDeg, hints: this.#shares(hints) });
    if (!this.running) return; // stopped meanwhile
    this.client.onLive = (answer) => this.#hear(answer);
    this.#watch();
  }

  stop() {
    this.running = false;
  }

  /** @param {{click?: number[] | number[][], exclude?: number[] | number[][], box?: number[]}} hints in the video's pixels */
  async mark(hints) {
    checkNames("tracker.mark", hints);
    if (this.running) await this.client.ask("markLive", { hints: this.#shares(hints) });
  }

  /** Pictures may come in another size. */
  #shares(hints) {
    checkHints(hints, this.video.videoWidth, this.video.videoHeight);
    return hintsOf(hints, 1 / this.video.videoWidth, 1 / this.video.videoHeight);
  }

  /** Another kind of light, from the next frame on. @param {import("../networks/lightOfObject.js").LightOptions} options */
  async set(options) {
    checkNames("tracker.set", options);
    checkLight(options);
    if (this.running) await this.client.ask("setLive", { options });
  }

  /** Lights and pictures a second. */
  rates() {
    const now = performance.now() / 1000;
    const rate = (times) => {
      while (times.length && times[0] < now - WINDOW_S) times.shift();
      return times.length / WINDOW_S;
    };
    return { updates: rate(this.updates), frames: rate(this.frames) };
  }

  /** Count the pictures that are shown, and give each away; the object over them follows its light alone. */
  #watch() {
    if (!this.running) return;
    this.frames.push(performance.now() / 1000);
    this.#give();
    const next = () => this.#watch();
    if (this.video.requestVideoFrameCallback) this.video.requestVideoFrameCallback(next);
    else requestAnimationFrame(next);
  }

  async #give() {
    const time = performance.now() / 1000;
    try {
      const taken = await takeFrame(this.video, this.client.spares);
      if (this.running) this.client.give(taken, time);
    } catch (error) {
      this.fail(error);
    }
  }

  #hear(answer) {
    if (!this.running) return;
    if (answer.error) return this.fail(receivedError(answer.error));
    if (!answer.lost) this.updates.push(performance.now() / 1000);
    if (!answer.light) return this.onLight(answer);
    if (answer.mask) this.mask = { data: answer.mask, width: answer.width, height: answer.height };
    this.onLight({ ...answer, light: new Light({ ...answer.light, mask: this.mask }) });
  }

  fail(error) {
    if (!this.running) return;
    this.running = false;
    this.onError(error);
  }
}
