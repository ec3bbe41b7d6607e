/** Frames of the camera to the networks' thread, one at a time, and how many a second come back. */

/** Rates are means over this many seconds. */
const WINDOW_S = 2;

export class LiveLight {
  /**
   * @param {HTMLVideoElement} video playing
   * @param {import("../networks/client.js").Networks} networks
   * @param {{onLight: (answer: object) => void, onFrame: () => void, onError: (error: Error) => void}} events
   */
  constructor(video, networks, { onLight, onFrame, onError }) {
    Object.assign(this, { video, networks, onLight, onFrame, onError });
    this.running = false;
    this.updates = [];
    this.draws = [];
  }

  async start(clicks, longFovDeg) {
    await this.networks.ask("startLive", { clicks, longFovDeg });
    this.running = true;
    this.#draw();
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
    return { updates: rate(this.updates), frames: rate(this.draws) };
  }

  #draw() {
    if (!this.running) return;
    this.draws.push(performance.now() / 1000);
    this.onFrame();
    requestAnimationFrame(() => this.#draw());
  }

  async #estimate() {
    while (this.running) {
      try {
        const bitmap = await createImageBitmap(this.video);
        const answer = await this.networks.ask("frame", { bitmap, time: performance.now() / 1000 }, [bitmap]);
        if (!this.running) return;
        if (answer.lost) await new Promise((resolve) => setTimeout(resolve, 100));
        else this.updates.push(performance.now() / 1000);
        this.onLight(answer);
      } catch (error) {
        this.running = false;
        this.onError(error);
      }
    }
  }
}
