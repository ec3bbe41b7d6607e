/** Estimate the light around an object of one material, in pictures and videos; types/ says what each method takes and gives. */

import { AnyProbeError, sentError } from "./errors.js";
import { described, give } from "./notices.js";
import { Light } from "./light/light.js";
import { checkSource } from "./live/frameSource.js";
import { Tracker } from "./live/tracker.js";
import { fetchMaskNetwork } from "./networks/maskFile.js";
import { checkSetup, requireBrowser } from "./networks/setup.js";
import { THREADS_FAILED } from "./networks/words.js";
import { WorkerClient } from "./networks/workerClient.js";
import { checkHints, checkNames, wrong } from "./checks.js";
import { hintsOf } from "./photo/hints.js";
import { lensOf } from "./photo/lens.js";
import { describe } from "./photo/material.js";
import { alphaDoubts, checkObject, lookAtGiven } from "./photo/maskCheck.js";
import { maskFromAlpha } from "./photo/picture.js";
import { readMask, readNormals, readSource } from "./photo/source.js";

export class AnyProbe {
  #client;
  #openMasks;
  #masks = null; // promise of the client of the thread that finds masks, since one was first wanted
  #tracker = null;

  /** Call load instead. */
  constructor(client, opened, openMasks = null) {
    this.#client = client;
    this.#openMasks = openMasks;
    Object.assign(this, opened);
  }

  /** Open the network of the light in a thread of its own; those of masks get another one when they are first wanted. */
  static async load(options = {}, files = {}) {
    checkNames("load", options);
    requireBrowser();
    const { worker, onProgress, ...given } = checkSetup(options, files);
    const start = async (asked, signal) => {
      const client = new WorkerClient(worker, onProgress);
      try {
        return [client, await client.ask("open", asked, signal)];
      } catch (error) {
        client.end(); // a runtime that did not open once never does
        throw error;
      }
    };
    const { light, mask, u2netp } = given.weights;
    const maskNetwork = u2netp ? "u2netp" : mask ? "small" : null;
    const masks = u2netp ? { u2netp } : { mask };
    const opened = async (threads) => {
      const [client, about] = await start({ ...given, threads, weights: { light } }, options.signal);
      const openMasks = async () => (await start({ ...given, threads: about.threads, weights: masks }))[0];
      return new this(client, { ...about, hasMask: maskNetwork !== null, maskNetwork }, openMasks);
    };
    try {
      return await opened(given.threads);
    } catch (error) {
      if (error.code !== THREADS_FAILED) throw error;
      console.warn(`anyprobe: ${given.threads} threads could not start (${error.message}); one is used.`);
      return opened(1);
    }
  }

  /** The better mask network, U2-Net-p: for load({ weights: { u2netp: await AnyProbe.fetchMaskNetwork(address) } }). */
  static async fetchMaskNetwork(address, options = {}) {
    checkNames("fetchMaskNetwork", options);
    return fetchMaskNetwork(address, options);
  }

  /** Find the object: numbers in [0, 1] of the picture's size, or of 1600 pixels along its longer side. */
  async mask(image, options = {}) {
    checkNames("mask", options);
    this.#client.check();
    const picture = await readSource(image, options.signal);
    const { mask, warnings, ...found } = await this.#findMask(picture, options);
    const told = warnings.map((one) => ({ ...one, remedy: one.remedy.filter(({ name }) => name !== "mask") })); // no option here
    return { ...found, data: mask, ...described(told), width: picture.width, height: picture.height };
  }

  /** Estimate the light around the object of one picture, in the frame of its camera. */
  async estimate(image, options = {}) {
    checkNames("estimate", options);
    const { surroundings, pitchDeg, signal } = options;
    const material = describe(options.material);
    this.#client.check();
    const picture = await readSource(image, signal);
    const { width, height } = picture;
    const lens = lensOf(options, picture);
    const normals = options.normals && readNormals(options.normals, picture);
    checkHints(options, picture.fullWidth, picture.fullHeight);
    const { mask, quality, warnings, marks } = await this.#maskOf(picture, options);
    const known = { longFovDeg: lens.longFovDeg, isLensKnown: lens.source !== "default" };
    const asked = { picture, mask, marks, normals, ...known, options: { surroundings, pitchDeg, material } };
    const { light } = await this.#client.ask("estimate", asked, signal);
    const own = { data: mask, width, height, quality, ...described(warnings) };
    return new Light({ ...light, warnings: [...warnings, ...light.warnings], mask: own, lens: light.lens ?? lens });
  }

  /** As estimate, of a picture in memory and its mask; says the seconds it took. */
  async examine(given) {
    const { light, seconds } = await this.#client.ask("estimate", given);
    return { light: new Light(light), seconds };
  }

  /** Estimate the light of every frame, steady on a still scene, following the object. A new source stops the tracker of the last one. */
  track(source, onLight, options = {}) {
    checkNames("track", options);
    if (typeof onLight !== "function") throw wrong("onLight", "a function", onLight);
    const { surroundings, pitchDeg, mask, onError, onLost, onMissed, onOutline, pose, signal } = options;
    refuseBoth(options);
    const material = describe(options.material);
    this.#client.check();
    const followed = checkSource(source);
    signal?.throwIfAborted();
    this.#tracker?.stop();
    const events = {
      pose,
      mask,
      onMissed,
      onAnswer: (answer) => {
        if (answer.light) onLight(answer.light, answer);
        else if (answer.lost) onLost?.(answer);
        else onOutline?.(answer);
      },
      onError: onError ?? ((error) => reportError(error)),
    };
    const tracker = (this.#tracker = new Tracker(followed, this.#client, events, () => (typeof mask === "function" ? null : this.#masksPort())));
    const { click, exclude, box, fovDeg, longFovDeg, projectionMatrix } = options;
    const given = { hints: { click, exclude, box }, lens: { fovDeg, longFovDeg, projectionMatrix } };
    tracker
      .start({ ...given, options: { surroundings, pitchDeg, material } })
      .catch((error) => tracker.running && tracker.fail(error));
    signal?.addEventListener("abort", () => tracker.stop(), { once: true });
    return tracker;
  }

  /** End the threads; open and later requests reject. */
  dispose() {
    this.#tracker?.stop();
    this.#client.end();
    this.#masks?.then((client) => client.end()).catch(() => {});
  }

  /** The client of the thread that finds masks. */
  async #finder() {
    this.#masks ??= this.#openMasks();
    try {
      return await this.#masks;
    } catch (error) {
      this.#masks = null;
      throw error;
    }
  }

  /** A line to that thread, so that lights go on while it looks; null without a network of masks. */
  #masksPort() {
    if (!this.hasMask || !this.#openMasks) return null;
    const { port1, port2 } = new MessageChannel();
    this.#finder()
      .then((client) => client.ask("open", { of: "camera", port: port1 }, undefined, [port1]))
      .catch((error) => port1.postMessage({ fault: sentError(error) }));
    return port2;
  }

  /** The given mask, the picture's own transparency, or what the marks find. */
  async #maskOf(picture, options) {
    const marks = refuseBoth(options);
    if (isGiven(options.mask)) {
      const mask = await readMask(options.mask, picture, options.signal);
      const { quality = null, notices } = options.mask; // of one that was found
      const looked = Array.isArray(notices) ? { mask, warnings: notices } : lookAtGiven(mask, picture.width);
      checkObject(looked.mask, picture.width, ["mask"]);
      return { quality, ...looked };
    }
    const own = marks.length ? null : maskFromAlpha(picture);
    if (own) {
      const { mask, warnings } = lookAtGiven(own, picture.width);
      return { mask, quality: null, warnings: [...warnings, ...alphaDoubts(own)] };
    }
    const found = await this.#findMask(picture, options);
    if (found.quality === 0) throw nothingFound(marks);
    return { ...found, marks };
  }

  async #findMask(picture, options) {
    checkHints(options, picture.fullWidth, picture.fullHeight);
    const client = this.#openMasks ? await this.#finder() : this.#client;
    return client.ask("mark", { picture, hints: hintsOf(options, picture.scale) }, options.signal);
  }
}

if (Symbol.dispose) {
  AnyProbe.prototype[Symbol.dispose] = AnyProbe.prototype.dispose;
}

const isGiven = (value) => value !== undefined && value !== null;

/** Names of the given marks, which exclude a mask. */
function refuseBoth(options) {
  const marks = ["click", "exclude", "box"].filter((name) => isGiven(options[name]) && options[name].length > 0);
  if (!isGiven(options.mask) || !marks.length) return marks;
  throw new AnyProbeError("invalid-option", "expected one of them, got both; leave one out", { subject: ["mask", ...marks] });
}

function nothingFound(marks) {
  if (marks.length === 0) {
    const text = "expected an object distinct from its surroundings, but nothing stands out";
    return new AnyProbeError("no-object", text, { remedy: give("click", "box", "mask") });
  }
  const on = marks.filter((name) => name !== "exclude");
  const text = `expected an object ${on.length ? `at the ${on.join(" and ")}` : "away from exclude"}, found none`;
  return new AnyProbeError("no-object", text, { remedy: give("box", "mask") });
}
