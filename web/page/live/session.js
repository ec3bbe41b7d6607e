/**
 * The camera's picture lit live: video in, virtual object over it, rates shown.
 */

import { DEFAULT_LONG_FOV_DEG } from "../../src/photo/crop.js";
import { element, setStatus, sendLight } from "../view/elements.js";
import { NO_HINTS } from "../view/maskEditor.js";
import { closeCamera, openCamera, watchCamera } from "./camera.js";
import { readFrame, takeFrame } from "../../src/live/videoFrames.js";

const RATES_EVERY_MS = 500;
const LIVE = "Live, in this browser. If the outline is wrong, click on the object below, or draw a box around it.";
const MISSED = "Nothing is found there. The last object is followed on: click on another below, or draw a box around it.";

export class LiveSession {
  /**
   * @param {object} parts of the page; options: what light is wanted now; onShown: the camera's picture has taken the
   *   photo's place; onMask: its mask is shown, with its quality; onFault: the camera, or what follows it, failed and is closed
   */
  constructor({ networks, config, stage, light, stages, editor, options, onShown, onMask, onFault }) {
    Object.assign(this, { networks, config, stage, light, stages, editor, options, onShown, onMask, onFault });
    this.button = element("camera");
    this.live = null; // since start was called; what was begun with one that is here no longer has been stopped
    this.running = false; // since the camera's first picture
  }

  /** Whether the camera is being asked for: what was on show still is. */
  get opening() {
    return Boolean(this.live) && !this.running;
  }

  /** Whether the networks are open and the camera's pictures go to them. */
  get following() {
    return Boolean(this.live?.tracker);
  }

  async start() {
    if (this.live) return; // the camera is being opened
    const live = { tracker: null, hints: {} };
    this.live = live;
    try {
      await this.#open(live);
    } catch (error) {
      this.#fail(live, error);
    }
  }

  async #open(live) {
    const { video } = this.stage;
    setStatus("Opening the camera …");
    const opening = this.networks.open(); // while the user is asked for the camera
    opening.catch(() => {}); // thrown where it is awaited
    const stream = await openCamera();
    if (this.live !== live) return closeCamera(stream);
    video.srcObject = stream;
    watchCamera(stream, (error) => this.#fail(live, error));
    await video.play();
    const still = await takePicture(video);
    if (this.live !== live) return;
    this.#begin(still);
    const probe = await opening;
    if (this.live !== live) return;
    const { hasMask, engine, threads } = probe;
    this.engine = `${engine === "webgpu" ? "WebGPU" : "WASM"}, ${threads} thread${threads > 1 ? "s" : ""}`;
    live.tracker = probe.track(video, (_, answer) => this.#show(answer), {
      ...live.hints,
      ...this.options(),
      withViews: true,
      onLost: (answer) => this.#show(answer),
      onError: (error) => this.#fail(live, error),
    });
    setStatus(hasMask ? "Finding the object …" : "Click on the object in the picture “Object” below.");
    this.timer = setInterval(() => this.#showRates(), RATES_EVERY_MS);
  }

  /** The camera's first picture takes the photo's place. */
  #begin(still) {
    this.running = true;
    this.button.setAttribute("aria-pressed", "true");
    this.said = null;
    this.pitchDeg = undefined; // until it is given
    this.isMaskDue = false;
    this.#fit(still);
    this.#look(still);
    this.onShown();
  }

  stop() {
    if (!this.live) return;
    this.live.tracker?.stop();
    this.live = null;
    this.running = false;
    clearInterval(this.timer);
    const { video } = this.stage;
    closeCamera(video.srcObject);
    video.srcObject = null;
    element("rates").hidden = true;
    this.button.setAttribute("aria-pressed", "false");
  }

  #fail(live, error) {
    if (this.live !== live) return; // it was stopped: what fails of it is of no interest
    this.stop();
    this.onFault(error);
  }

  /** @param {import("../../src/photo/picture.js").Hints} hints in pixels of the still picture */
  async mark(hints) {
    const { on, off, box } = hints;
    const { live, still, found } = this;
    const { videoWidth, videoHeight } = this.stage.video;
    const place = ([x, y]) => [(x * videoWidth) / still.width, (y * videoHeight) / still.height];
    this.placed = false;
    this.said = null;
    this.#mark(hints);
    live.hints = { click: on.map(place), exclude: off.map(place), box: box && [...place(box.slice(0, 2)), ...place(box.slice(2))] };
    await live.tracker?.mark(live.hints);
    if (this.live === live) Object.assign(this, { found, placed: false }); // an answer that was under way told the old mask
  }

  #mark(hints) {
    this.marked = hints;
    this.missed = false;
  }

  /** Another kind of light is wanted. */
  setOptions() {
    return this.live.tracker?.set(this.options());
  }

  #show(answer) {
    if (answer.width !== this.size.width || answer.height !== this.size.height) this.#turn(answer);
    if (answer.missed) {
      this.#mark(this.found);
      this.missed = this.isMaskDue = true;
    }
    if (answer.lost) return this.#say("No object is seen. Click on it in the picture “Object” below.");
    if (answer.mask) this.#setMask(answer);
    if (!this.placed) return;
    this.#say(this.missed ? MISSED : LIVE);
    this.stage.setLight(answer.light);
    sendLight(answer);
    // one part of the rest at a time: pictures of the camera wait for what is drawn here
    if (answer.spheres) {
      const about = { photo: "camera", model: this.config.model, longFovDeg: DEFAULT_LONG_FOV_DEG };
      this.light.show({ light: answer.light, spheres: answer.spheres }, about);
    } else if (answer.stages) {
      this.stages.show(answer.stages, answer.light.radiance);
      this.isMaskDue = true;
    } else if (this.isMaskDue) {
      this.isMaskDue = false;
      this.#showMask();
    }
  }

  /** The state once, not with every light: each line is read aloud, and others' lines stay until it changes. */
  #say(text) {
    if (text === this.said) return;
    this.said = text;
    setStatus(text);
  }

  /** Pictures of another size from here on: the object has no place in them yet. */
  #fit({ width, height }) {
    this.size = { width, height };
    this.mask = null;
    this.placed = false;
    this.stage.showVideo();
  }

  /** The camera is held another way; frameLight.js has forgotten what was marked and found before, too. */
  async #turn(size) {
    this.#fit(size);
    const still = await this.#takeStill();
    if (still) this.#look(still);
  }

  /** A still picture to click in. */
  #look(still) {
    this.still = still;
    this.#mark(NO_HINTS);
    this.found = NO_HINTS;
    this.editor.open(still);
  }

  #setMask({ width, height, mask, quality, box }) {
    Object.assign(this, { mask, quality, found: this.marked });
    if (this.placed) return this.stage.stage.setMask(mask);
    this.stage.place(width, height, null, mask, box, this.pitchDeg === undefined ? null : { pitchDeg: this.pitchDeg });
    this.placed = true;
  }

  async #showMask() {
    const { mask, quality, size } = this;
    const still = await this.#takeStill();
    if (!still || this.size !== size || still.width !== size.width || still.height !== size.height) return;
    this.still = still;
    this.editor.showOn(still, mask, this.marked);
    this.onMask({ quality, notices: [] });
  }

  /** What the camera shows now, or null where it has been stopped meanwhile. */
  async #takeStill() {
    const { live } = this;
    try {
      const still = await takePicture(this.stage.video);
      return this.live === live ? still : null;
    } catch (error) {
      this.#fail(live, error);
      return null;
    }
  }

  #showRates() {
    const { updates, frames } = this.live.tracker.rates();
    element("rates").textContent = `${updates.toFixed(0)} lights/s · ${frames.toFixed(0)} frames/s · ${this.engine}`;
    element("rates").hidden = false;
  }
}

/** What the camera shows, for the picture in which the object is clicked on. */
async function takePicture(video) {
  return readFrame((await takeFrame(video)).frame);
}
