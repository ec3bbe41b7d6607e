/**
 * The camera's picture lit live: video in, virtual object over it, rates shown.
 *
 * Every light is told to whoever listens to the document's event "anyprobe-light".
 */

import { DEFAULT_LONG_FOV_DEG } from "../photo/crop.js";
import { element, setStatus } from "../view/elements.js";
import { LiveLight } from "./liveLight.js";
import { closeCamera, openCamera } from "./camera.js";
import { readFrame, takeFrame } from "./frames.js";

const RATES_EVERY_MS = 500;

export class LiveSession {
  /** @param {object} parts of the page; asked: tells what is asked of the light now, see networks/worker.js */
  constructor({ networks, config, stage, light, stages, editor, asked }) {
    Object.assign(this, { networks, config, stage, light, stages, editor, asked });
    this.button = element("camera");
    this.live = null;
  }

  get running() {
    return this.live !== null;
  }

  async start() {
    const { video } = this.stage;
    setStatus("Opening the camera …");
    const opening = this.networks.open(this.config); // while the user is asked for the camera
    opening.catch(() => {}); // told where it is awaited
    video.srcObject = await openCamera();
    await video.play();
    this.stage.showVideo();
    this.placed = false;
    this.button.setAttribute("aria-pressed", "true");
    this.live = new LiveLight(video, this.networks, {
      onLight: (answer) => this.#show(answer),
      onError: (error) => {
        this.stop();
        setStatus(error.message, true);
      },
    });
    const { live } = this;
    this.still = await takePicture(video);
    this.editor.open(this.still);
    const { hasMask, provider, threads } = await opening;
    if (this.live !== live) return; // stopped meanwhile
    this.engine = `${provider === "webgpu" ? "WebGPU" : "WASM"}, ${threads} thread${threads > 1 ? "s" : ""}`;
    await live.start({ on: [], off: [], box: null }, DEFAULT_LONG_FOV_DEG, this.asked());
    setStatus(hasMask ? "Live. Click on the object if another is marked." : "Click on the object in the picture “Object” below.");
    element("rates").hidden = false;
    this.timer = setInterval(() => this.#showRates(), RATES_EVERY_MS);
  }

  stop() {
    if (!this.live) return;
    this.live.stop();
    this.live = null;
    clearInterval(this.timer);
    closeCamera(this.stage.video);
    element("rates").hidden = true;
    this.button.setAttribute("aria-pressed", "false");
  }

  /** @param {import("../photo/picture.js").Hints} hints in pixels of the still picture */
  mark({ on, off, box }) {
    const { width, height } = this.still;
    const shares = (points) => points.map(([x, y]) => [x / width, y / height]);
    this.placed = false;
    return this.live.mark({ on: shares(on), off: shares(off), box: box && shares([box.slice(0, 2), box.slice(2)]).flat() });
  }

  /** What is asked of the light has changed. */
  ask() {
    return this.live.ask(this.asked());
  }

  #show(answer) {
    if (answer.lost) return setStatus("No object is seen. Click on it in the picture “Object” below.");
    if (answer.mask) this.#setMask(answer);
    if (!this.placed) return;
    this.stage.setLight(answer.light);
    document.dispatchEvent(new CustomEvent("anyprobe-light", { detail: answer }));
    // one part of the rest at a time: pictures of the camera wait for what is drawn here
    if (answer.balls) {
      const about = { photo: "camera", model: this.config.model, longFovDeg: DEFAULT_LONG_FOV_DEG };
      const { light, balls, known, spread } = answer;
      this.light.show({ light, balls, known, spread }, about);
    } else if (answer.stages) {
      this.stages.show(answer.stages, answer.light.radiance);
      this.isMaskDue = true;
    } else if (this.isMaskDue) {
      this.isMaskDue = false;
      this.#showMask();
    }
  }

  #setMask({ width, height, mask, box }) {
    this.mask = mask;
    if (this.placed) return this.stage.stage.setMask(mask);
    this.stage.place(width, height, DEFAULT_LONG_FOV_DEG, mask, box);
    this.placed = true;
    setStatus("Live, in this browser.");
  }

  async #showMask() {
    const { video } = this.stage;
    const { mask } = this;
    if (!this.live || !video.srcObject) return;
    this.still = await takePicture(video);
    if (this.live && mask.length === this.still.width * this.still.height) this.editor.showOn(this.still, mask);
  }

  #showRates() {
    const { updates, frames } = this.live.rates();
    element("rates").textContent = `${updates.toFixed(0)} lights/s · ${frames.toFixed(0)} frames/s · ${this.engine}`;
  }
}

/** What the camera shows, for the picture in which the object is clicked on. */
async function takePicture(video) {
  return readFrame((await takeFrame(video)).frame);
}
