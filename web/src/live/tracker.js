/** Every frame of a video to the networks' thread, which takes the newest, and the lights that come back. */

import { Light } from "../light/light.js";
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
    this.updates = [];
    this.frames = [];
  }

  /** @param {{hints: object, longFovDeg: number, options: object, withViews: boolean}} given hints as of mark */
  async start({ hints, ...given }) {
    this.running = true;
    await this.client.ask("startLive", { ...given, hints: this.#shares(hints) });
    if (!this.running) return; // stopped meanwhile
    this.client.onLive = (answer) => this.#hear(answer);
    this.#watch();
  }

  stop() {
    this.running = false;
  }

  /** @param {{click?: number[] | number[][], exclude?: number[] | number[][], box?: number[]}} hints in the video's pixels */
  async mark(hints) {
    if (this.running) await this.client.ask("markLive", { hints: this.#shares(hints) });
  }

  /** Pictures may come in another size. */
  #shares(hints) {
    return hintsOf(hints, 1 / this.video.videoWidth, 1 / this.video.videoHeight);
  }

  /** Another kind of light, from the next frame on. @param {import("../networks/lightOfObject.js").LightOptions} options */
  async set(options) {
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
      this.#fail(error);
    }
  }

  #hear(answer) {
    if (!this.running) return;
    if (answer.error) return this.#fail(new Error(answer.error));
    if (!answer.lost) this.updates.push(performance.now() / 1000);
    this.onLight(answer.light ? { ...answer, light: new Light(answer.light) } : answer);
  }

  #fail(error) {
    if (!this.running) return;
    this.running = false;
    this.onError(error);
  }
}
