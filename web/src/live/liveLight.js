/** Frames of the camera to the networks' thread, one at a time, and how many a second come back. */

import { takeFrame } from "./frames.js";

/** Rates are means over this many seconds. */
const WINDOW_S = 2;

/** Between two tries while no object is seen. */
const LOST_MS = 100;

export class LiveLight {
  /**
   * @param {HTMLVideoElement} video playing
   * @param {import("../networks/client.js").Networks} networks
   * @param {{onLight: (answer: object) => void, onError: (error: Error) => void}} events
   */
  constructor(video, networks, { onLight, onError }) {
    Object.assign(this, { video, networks, onLight, onError });
    this.running = false;
    this.updates = [];
    this.frames = [];
  }

  async start(clicks, longFovDeg) {
    await this.networks.ask("startLive", { clicks, longFovDeg });
    this.running = true;
    this.#countFrames();
    this.#estimate();
  }

  stop() {
    this.running = false;
  }

  /** @param {{on: number[][], off: number[][]}} clicks x, y as shares of width and height */
  click(clicks) {
    return this.networks.ask("clickLive", { clicks });
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

  /** The object over a picture is drawn anew when its light or its place changes; the pictures follow the camera. */
  #countFrames() {
    if (!this.running) return;
    this.frames.push(performance.now() / 1000);
    const next = () => this.#countFrames();
    if (this.video.requestVideoFrameCallback) this.video.requestVideoFrameCallback(next);
    else requestAnimationFrame(next);
  }

  /** Frame after frame; the networks have the next one before the last one's light is shown. */
  async #estimate() {
    try {
      let asked = await this.#ask();
      while (this.running) {
        const answer = await asked.answer;
        if (!this.running) return;
        if (answer.lost) await new Promise((resolve) => setTimeout(resolve, LOST_MS));
        else this.updates.push(performance.now() / 1000);
        asked = await this.#ask();
        if (this.running) this.onLight(answer);
      }
    } catch (error) {
      this.running = false;
      this.onError(error);
    }
  }

  /** Give the networks the camera's picture of now; the answer is a promise of its own, not awaited here. */
  async #ask() {
    const { frame, transfer } = await takeFrame(this.video);
    const answer = this.networks.ask("frame", { frame, time: performance.now() / 1000 }, transfer);
    answer.catch(() => {}); // told where it is awaited, if it still is
    return { answer };
  }
}
