/** Send a source's frames to the networks' thread, which takes the newest, and hand on the lights that come back. */

import { AnyProbeError, foreign, receivedError } from "../errors.js";
import { Light } from "../light/light.js";
import { checkHints, checkNames, wrong } from "../checks.js";
import { hintsOf } from "../photo/hints.js";
import { lensOf } from "../photo/lens.js";
import { isEarly, readMask, sizeOf } from "../photo/source.js";
import { describe } from "../photo/material.js";
import { checkFrame, follow } from "./frameSource.js";
import { rotationOfPose } from "./pose.js";
import { readSize, takeFrame } from "./videoFrames.js";

/** Rates are means over this many seconds. */
const WINDOW_S = 2;

/** Number of times kept: more than there are pictures in that window. */
const MOST_TIMES = 1000;

function noteTime(times) {
  times.push(performance.now() / 1000);
  if (times.length > MOST_TIMES) times.splice(0, MOST_TIMES / 2);
}

export class Tracker {
  #source;
  #client;
  #pose;
  #mask;
  #masksPort;
  #size = null; // of the pictures that hints are in pixels of
  #given;
  #opening = null;
  #unfollow = () => {};
  #isOpen = false; // before that, what comes is of the source before
  #isReading = false;
  #fault = null; // what has ended it

  /**
   * @param {HTMLVideoElement | HTMLCanvasElement | OffscreenCanvas | MediaStreamTrack | null} source null: frames are offered
   * @param {import("../networks/workerClient.js").WorkerClient} client
   * @param {{onAnswer: (answer: object) => void, onError: (error: AnyProbeError) => void, onMissed?: () => void, pose?: () => object,
   *   mask?: object | ((frame: object) => object)}} events
   *   pose: of the camera in the world, asked for when a frame is taken; mask: where the object is in the first frame, or a
   *   function that says it of each one, null where it is not in it
   * @param {() => MessagePort | null} [masksPort] of a thread that finds masks
   */
  constructor(source, client, { onAnswer, onError, onMissed, pose, mask }, masksPort) {
    this.#masksPort = masksPort;
    this.#source = source;
    this.#client = client;
    this.#pose = pose;
    this.#mask = mask;
    Object.assign(this, { onAnswer, onError, onMissed });
    this.running = false;
    this.mask = null; // the last one found
    this.updates = [];
    this.frames = [];
  }

  /** @param {{hints: object, lens: object, options: object}} given hints as of mark */
  async start(given) {
    this.running = true;
    this.#given = given;
    if (this.#source && sizeOf(this.#source)[0] > 0 && !isEarly(this.#source)) await this.#open(this.#source);
    if (!this.running) return; // stopped meanwhile
    this.#client.onLive = (answer) => this.#hear(answer);
    const give = async (frame) => {
      try {
        await this.offer(frame, { pose: this.#pose?.() });
      } catch (error) {
        this.fail(error); // of the caller's pose
      }
    };
    const unfollow = await follow(this.#source, give, (error) => this.fail(error));
    if (this.running) this.#unfollow = unfollow;
    else unfollow();
  }

  /** Start tracking in the networks' thread once the pictures' size is known. */
  #open(picture) {
    return (this.#opening ??= (async () => {
      const [width, height] = (this.#size = sizeOf(picture));
      const { hints, lens, ...given } = this.#given;
      this.lens = lensOf(lens, { width, height });
      const asked = { ...given, longFovDeg: this.lens.longFovDeg, isLensKnown: this.lens.source !== "default", hints: this.#shares(hints) };
      const port = this.#masksPort?.();
      await this.#client.ask("open", { of: "camera", ...asked, port }, undefined, port ? [port] : []);
      this.#isOpen = true;
    })());
  }

  /** A frame of one's own, and the camera's pose when it was taken. Only the newest is processed. */
  async offer(frame, about = {}) {
    if (this.#fault) throw this.#fault;
    checkNames("tracker.offer", about);
    const { pose, mask, time = performance.now() } = about;
    if (!Number.isFinite(time)) throw wrong("time", "milliseconds of performance.now()", time);
    checkFrame(frame);
    const rotation = pose === undefined || pose === null ? null : rotationOfPose(pose);
    if (!this.running || isEarly(frame) || !(sizeOf(frame)[0] > 0)) return;
    noteTime(this.frames);
    const isSlow = frame.texture || mask || this.#mask;
    if (isSlow && this.#isReading) return;
    try {
      this.#isReading = true;
      const opening = this.#ending(() => this.#open(frame));
      const taking = Promise.all([takeFrame(frame, this.#client.spares), this.#maskOf(frame, mask), opening]);
      const [taken, given] = await taking.finally(() => (this.#isReading = false));
      if (this.running) this.#client.give(taken, time / 1000, rotation, given);
      else taken.frame.close?.();
    } catch (error) {
      throw error?.name === "DataCloneError" ? foreign("frame") : ours(error); // a bitmap of a tainted canvas
    }
  }

  /** The caller's own mask of a frame, as small as the frame is looked at; null where there is none. */
  #maskOf(frame, offered) {
    return offered === undefined ? this.#ending(() => this.#ownMask(frame)) : this.#readMask(offered, frame);
  }

  async #ownMask(frame) {
    const own = this.#mask;
    if (own === undefined) return null;
    if (typeof own !== "function") this.#mask = undefined; // of the first frame alone
    const mask = typeof own === "function" ? await own(frame) : own;
    if (mask === undefined) throw wrong("mask", "a function that gives a mask, or null where the object is not seen", mask);
    return this.#readMask(mask, frame);
  }

  async #readMask(mask, frame) {
    const [fullWidth, fullHeight] = sizeOf(frame);
    const [width, height] = readSize(fullWidth, fullHeight);
    if (mask === null) return { width, height, data: new Float32Array(width * height) };
    return { width, height, data: await readMask(mask, { width, height, fullWidth, fullHeight }) };
  }

  stop() {
    this.running = false;
    this.#unfollow();
  }

  /** @param {{click?: number[] | number[][], exclude?: number[] | number[][], box?: number[]}} hints in the source's pixels */
  async mark(hints = {}) {
    checkNames("tracker.mark", hints);
    if (this.running && !this.#opening) this.#given = { ...this.#given, hints };
    else if (this.running) await this.#client.ask("mark", { of: "camera", hints: this.#shares(hints) });
  }

  /** Pictures may come in another size. */
  #shares(hints) {
    const [width, height] = this.#source && sizeOf(this.#source)[0] > 0 ? sizeOf(this.#source) : (this.#size ?? [0, 0]);
    checkHints(hints, width, height);
    return hintsOf(hints, 1 / width, 1 / height);
  }

  /** Another kind of light, from the next frame on; what is not named stays. @param {import("../networks/lightOfObject.js").LightOptions} options */
  async set(options = {}) {
    checkNames("tracker.set", options);
    const changed = "material" in options ? { ...options, material: describe(options.material) } : options;
    if (this.running && !this.#opening) this.#given = { ...this.#given, options: { ...this.#given.options, ...changed } };
    else if (this.running) await this.#client.ask("mark", { of: "camera", options: changed });
  }

  /** Lights and pictures a second. */
  rates() {
    const now = performance.now() / 1000;
    const rate = (times) => times.filter((time) => time >= now - WINDOW_S).length / WINDOW_S;
    return { updates: rate(this.updates), frames: rate(this.frames) };
  }

  #hear(answer) {
    if (!this.running || (!this.#isOpen && !answer.error)) return;
    if (answer.error) return this.fail(receivedError(answer.error));
    if (answer.held) return;
    if (answer.missed) this.onMissed?.();
    if (answer.mask) this.mask = { data: answer.mask, width: answer.width, height: answer.height, quality: answer.quality };
    if (!answer.light) return this.onAnswer(answer);
    noteTime(this.updates);
    this.onAnswer({ ...answer, light: new Light({ ...answer.light, mask: this.mask, lens: this.lens }) });
  }

  /** An error in the tracking options ends it. */
  async #ending(work) {
    try {
      return await work();
    } catch (error) {
      this.fail(error);
      throw error;
    }
  }

  fail(error) {
    if (!this.running) return;
    this.stop();
    this.#fault = ours(error);
    this.onError(this.#fault);
  }
}

/** An error of the caller's functions or the browser, as an error of this package. */
const ours = (error) => (error instanceof AnyProbeError ? error : new AnyProbeError("failed", String(error?.message ?? error), { cause: error }));
