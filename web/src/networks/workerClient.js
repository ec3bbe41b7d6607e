/**
 * The caller's side of the networks' thread: one promise a request.
 *
 * Not by Comlink: there, what is asked of a thread that ends or never starts stays open for ever, an error arrives without
 * its code, and a request cannot be given up.
 */

import { AnyProbeError, receivedError, sentError } from "../errors.js";
import { wrong } from "../checks.js";
import { VITE_NEEDS } from "./words.js";

export class WorkerClient {
  #worker;
  #waiting = new Map();
  #count = 0;
  #fault = null;

  /** Hears the lights of a video's frames. */
  onLive = () => {};

  /** Memory of textures that are done with. */
  spares = [];

  /**
   * @param {(() => Worker) & {address?: string}} start address: of the caller's own script
   * @param {(progress: import("../files/download.js").Progress) => void} onProgress while files are fetched
   */
  constructor(start, onProgress) {
    this.#worker = started(start);
    let isStarted = false;
    this.#worker.onmessage = ({ data }) => {
      isStarted = true;
      if (data.progress) return onProgress(data.progress);
      if (data.fault) return this.#end(receivedError(data.fault));
      if (data.live) return this.onLive(data.live);
      if (data.spare) return this.spares.push(data.spare);
      const asked = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if (data.error === undefined) asked?.resolve(data.result); // nobody waits for what was given up
      else asked?.reject(receivedError(data.error));
    };
    this.#worker.onerror = (event) => {
      const ofEntry = `; esbuild and Rollup copy none: use anyprobe/core, for which a content security policy needs worker-src blob:; ${VITE_NEEDS}`;
      const missing = `its script could not be fetched${start.address ? ` from ${start.address}` : ofEntry}`;
      const why = event.message?.replace(/\.$/, "") || missing;
      const isOffline = !event.message && globalThis.navigator?.onLine === false;
      const fault = `The networks' thread ${isStarted ? "ended" : "could not be started"}: ${why}.`;
      this.#end(new AnyProbeError("worker-failed", isOffline ? "No connection: the networks could not be fetched; try again." : fault));
      this.onLive({ error: sentError(this.#fault) });
    };
  }

  /**
   * Ask the thread, see worker.js.
   *
   * @param {"open" | "mark" | "estimate"} say
   * @param {object} [given] of: "camera", else a still picture
   * @param {Transferable[]} [transfer]
   */
  async ask(say, given = {}, signal = undefined, transfer = []) {
    if (this.#fault) throw this.#fault;
    signal?.throwIfAborted();
    const id = this.#count++;
    const giveUp = () => {
      this.#waiting.get(id)?.reject(signal.reason);
      this.#waiting.delete(id);
      this.#worker.postMessage({ giveUp: id });
    };
    signal?.addEventListener("abort", giveUp, { once: true });
    try {
      return await new Promise((resolve, reject) => {
        this.#waiting.set(id, { resolve, reject });
        this.#worker.postMessage({ id, say, ...given }, transfer);
      });
    } finally {
      signal?.removeEventListener("abort", giveUp);
    }
  }

  /** A frame of a video; onLive hears its light, unless a newer one overtakes it. */
  give({ frame, transfer }, time, pose = null, mask = null) {
    if (!this.#fault) this.#worker.postMessage({ say: "estimate", of: "camera", frame, time, pose, mask }, transfer);
  }

  /** Throws once it has ended. */
  check() {
    if (this.#fault) throw this.#fault;
  }

  end() {
    this.#end(new AnyProbeError("disposed", "The light probe was disposed of; load another."));
  }

  #end(error) {
    this.#worker.terminate();
    this.#fault ??= error;
    for (const { reject } of this.#waiting.values()) reject(this.#fault);
    this.#waiting.clear();
  }
}

function started(start) {
  let worker;
  try {
    worker = start();
  } catch (error) {
    throw new AnyProbeError("worker-failed", `The networks' thread could not be started: ${String(error.message).replace(/\.$/, "")}.`);
  }
  if (typeof worker?.postMessage !== "function") throw wrong("worker", "a function that gives a Worker", worker);
  return worker;
}
