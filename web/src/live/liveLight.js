/** Every frame of the camera to the networks' thread, which takes the newest, and the lights that come back. */

import { takeFrame } from "./videoFrames.js";

/** Rates are means over this many seconds. */
const WINDOW_S = 2;

export class LiveLight {
  /**
   * @param {HTMLVideoElement} video playing
   * @param {import("../networks/workerClient.js").Networks} networks
   * @param {{onLight: (answer: object) => void, onError: (error: Error) => void}} events
   */
  constructor(video, networks, { onLight, onError }) {
    Object.assign(this, { video, networks, onLight, onError });
    this.running = false;
    this.hints = { on: [], off: [], box: null };
    this.updates = [];
    this.frames = [];
  }

  async start(longFovDeg, asked) {
    this.running = true;
    await this.networks.ask("startLive", { hints: this.hints, longFovDeg, asked });
    if (!this.running) return; // stopped meanwhile
    this.networks.onLive = (answer) => this.#hear(answer);
    this.#watch();
  }

  stop() {
    this.running = false;
  }

  /** @param {import("../photo/picture.js").Hints} hints as shares of width and height; before the start they are held */
  async mark(hints) {
    this.hints = hints;
    if (this.running) await this.networks.ask("markLive", { hints });
  }

  /** Another kind of light, from the next frame on. @param {import("../networks/worker.js").Asked} asked */
  async ask(asked) {
    if (this.running) await this.networks.ask("askLive", { asked });
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
      const taken = await takeFrame(this.video, this.networks.spares);
      if (this.running) this.networks.give(taken, time);
    } catch (error) {
      this.#fail(error);
    }
  }

  #hear(answer) {
    if (!this.running) return;
    if (answer.error) return this.#fail(new Error(answer.error));
    if (!answer.lost) this.updates.push(performance.now() / 1000);
    this.onLight(answer);
  }

  #fail(error) {
    if (!this.running) return;
    this.running = false;
    this.onError(error);
  }
}
