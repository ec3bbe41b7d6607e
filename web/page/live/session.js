/** Live light of the camera: its picture, the virtual object over it, and the rates. */

import { DEFAULT_LONG_FOV_DEG } from "../../src/photo/lens.js";
import { element, setStatus, sendLight } from "../view/elements.js";
import { NO_HINTS } from "../view/marking.js";
import { closeCamera, openCamera, watchCamera } from "./camera.js";
import { readSize } from "../../src/live/videoFrames.js";
import { objectBox } from "../../src/photo/picture.js";
import { resize } from "../../src/photo/resize.js";
import { readSource } from "../../src/photo/source.js";

const RATES_EVERY_MS = 500;

/** Seconds between two lights of which the panel is drawn. */
const PANEL_S = 0.5;

/** Seconds for which an object's motion is extrapolated, and the largest age of the answer that gives its speed. */
const LONGEST_S = 0.5;
const LIVE = "Live, in this browser. If the outline is wrong, click on the object, or draw a box around it.";
const FINDING = "Finding the object …";
const MISSED = "Nothing is found there. The last object is followed on: click on another, or draw a box around it.";

export class LiveSession {
  /**
   * @param {object} parts of the page; options: what light is wanted now; onShown: the camera's picture has taken the
   *   photo's place; onMask: its mask is shown, with its quality; onFault: the camera, or what follows it, failed and is closed
   */
  constructor({ networks, config, stage, light, marking, options, onShown, onMask, onFault }) {
    Object.assign(this, { networks, config, stage, light, marking, options, onShown, onMask, onFault });
    this.button = element("camera");
    this.live = null; // since start was called; what was begun with one that is here no longer has been stopped
    this.running = false; // since the camera's first picture
  }

  /** Whether the camera is being requested, while the last picture stays on show. */
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
    if (this.live !== live) return;
    this.#begin();
    const probe = await opening;
    if (this.live !== live) return;
    const { hasMask, threads } = probe;
    this.threads = `${threads} thread${threads > 1 ? "s" : ""}`;
    live.tracker = probe.track(video, (_, answer) => this.#show(answer), {
      ...live.hints,
      ...this.options(),
      onLost: (answer) => this.#show(answer),
      onOutline: (answer) => this.#show(answer),
      onError: (error) => this.#fail(live, error),
    });
    setStatus(hasMask ? FINDING : "Click on the object.");
    this.timer = setInterval(() => this.#showRates(), RATES_EVERY_MS);
  }

  /** Show the camera's first picture in place of the photo. */
  #begin() {
    this.running = true;
    this.#nameButton();
    this.said = this.quality = this.asking = this.shown = this.motion = this.panelTime = null;
    this.pitchDeg = undefined; // until it is given
    this.#fit();
    this.onShown();
    this.#glide();
  }

  #nameButton() {
    this.button.textContent = this.running ? "Stop" : "Camera";
    this.button.classList.toggle("running", this.running);
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
    this.#nameButton();
  }

  #fail(live, error) {
    if (this.live !== live) return; // it was stopped: what fails of it is of no interest
    this.stop();
    this.onFault(error);
  }

  /** @param {import("../../types/index.d.ts").Hints} hints in pixels of the video */
  async mark(hints) {
    const { live } = this;
    this.said = null;
    if (live.tracker) this.#say(FINDING); // no answer comes meanwhile if nothing is followed
    this.#mark((live.hints = hints));
    const asking = (this.asking = live.tracker?.mark(hints)); // until it is heard, answers tell of what was marked before
    await asking;
    if (this.asking === asking) this.asking = null;
  }

  #mark(hints) {
    this.marked = hints;
    this.missed = false;
  }

  /** Ask for another kind of light. */
  setOptions() {
    return this.live.tracker?.set(this.options());
  }

  #show(answer) {
    const { width, height } = this.size;
    if (answer.width !== width || answer.height !== height) this.#fit(answer);
    if (answer.missed) {
      this.#mark(this.found);
      this.missed = true;
    }
    if (answer.lost) {
      this.marking.show(null, this.marked);
      return this.#say("No object is seen. Click on it, or draw a box around it.");
    }
    const isSearching = answer.searching || this.asking;
    if (answer.mask && !isSearching) this.#setMask(answer);
    if (!this.placed || !answer.light) return;
    this.#say(isSearching ? FINDING : this.missed ? MISSED : LIVE);
    this.stage.setLight(answer.light);
    sendLight(answer);
    this.shown = { light: answer.light };
    if (answer.time - this.panelTime < PANEL_S) return;
    this.panelTime = answer.time;
    this.light.show(this.shown, { photo: "camera", model: this.config.model, longFovDeg: DEFAULT_LONG_FOV_DEG });
  }

  /** The state once, not with every light: each line is read aloud, and others' lines stay until it changes. */
  #say(text) {
    if (text === this.said) return;
    this.said = text;
    setStatus(text);
  }

  /**
   * Pictures of this size from here on, as the camera is held: the object has no place in them yet, and nothing is marked, which
   * frameLight.js has forgotten too.
   */
  #fit(size) {
    const { videoWidth, videoHeight } = this.stage.video;
    const [width, height] = size ? [size.width, size.height] : readSize(videoWidth, videoHeight);
    this.size = { width, height };
    this.placed = false;
    this.motion = null;
    this.#mark(NO_HINTS);
    this.found = NO_HINTS;
    this.stage.showVideo();
    this.marking.open({ width: videoWidth, height: videoHeight });
  }

  #setMask({ time, width, height, mask, quality, box }) {
    const isPlaced = this.placed && this.found === this.marked;
    this.found = this.marked;
    this.marking.follow({ data: mask, width, height }, this.marked);
    this.#noteMotion(time, [(box[0] + box[2]) / 2 / width, (box[1] + box[3]) / 2 / height], isPlaced);
    this.object = { mask, width, height, quality };
    if (quality !== this.quality) this.onMask({ quality, notices: [] });
    this.quality = quality;
    if (isPlaced) return this.stage.stage.setMask(mask);
    this.stage.place(width, height, null, mask, box, this.pitchDeg === undefined ? null : { pitchDeg: this.pitchDeg });
    this.placed = true;
  }

  /** Where the object is in the picture of an answer, and how fast it moves, in shares of the picture. */
  #noteMotion(time, at, isSame) {
    const { motion } = this;
    const seconds = time - motion?.time;
    const isKnown = isSame && seconds > 0 && seconds < LONGEST_S;
    this.motion = { time, at, speed: at.map((place, axis) => (isKnown ? (place - motion.at[axis]) / seconds : 0)) };
  }

  /** With each picture the outline goes where the object is by now: the last answer's is of an older one. */
  #glide() {
    const { live, motion } = this;
    this.stage.video.requestVideoFrameCallback?.(() => {
      if (this.live === live && this.running) this.#glide();
    });
    if (!motion) return;
    const age = Math.min(Math.max(performance.now() / 1000 - motion.time, 0), LONGEST_S);
    this.marking.glide(...motion.speed.map((speed) => speed * age));
  }

  /** The camera's last picture as a photo, with its object and light; null before there is a light. */
  async still() {
    const { live, object, shown, pitchDeg } = this;
    const picture = this.placed && shown && (await readSource(this.stage.video));
    if (!picture || this.live !== live) return null;
    const mask = resize(object.mask, 1, [object.width, object.height], [picture.width, picture.height]);
    const found = { data: mask, quality: object.quality, notices: [] };
    const lens = { longFovDeg: DEFAULT_LONG_FOV_DEG, lensDeg: null };
    return { picture, ...lens, name: "camera", mask, box: objectBox(mask, picture.width), found, result: shown, pitchDeg };
  }

  #showRates() {
    const { updates } = this.live.tracker.rates();
    element("rates").textContent = `${updates.toFixed(0)} lights a second · ${this.threads}`;
    element("rates").hidden = false;
  }
}
