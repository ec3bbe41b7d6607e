/** The page's side of the networks' thread: one promise a request. */

export class Networks {
  #worker = null;
  #waiting = new Map();
  #count = 0;

  /** Hears what is told of the camera's frames. */
  onLive = () => {};

  /** Memory of frames that are done with. */
  spares = [];

  /**
   * @param {(progress: {done: number, of: number}) => void} onProgress while networks are opened
   * @param {number} sparedCores how many the networks leave to others
   */
  constructor(onProgress, sparedCores) {
    this.sparedCores = sparedCores;
    this.onProgress = onProgress;
  }

  #begin() {
    const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
    worker.onmessage = ({ data }) => {
      if (data.progress) return this.onProgress(data.progress);
      if (data.live) return this.onLive(data.live);
      if (data.spare) return this.spares.push(data.spare);
      const { resolve, reject } = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if (data.error === undefined) resolve(data.result);
      else reject(new Error(data.error));
    };
    worker.onerror = (event) => {
      const error = new Error(event.message || "The networks' thread could not be started.");
      for (const { reject } of this.#waiting.values()) reject(error);
      this.#waiting.clear();
    };
    return worker;
  }

  /** An engine that did not open once never does: the next call of open begins with another thread. */
  #end() {
    this.#worker.terminate();
    this.#worker = this.opened = null;
  }

  /** Ask for a task of worker.js. */
  ask(task, given = {}, transfer = []) {
    const id = this.#count++;
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ id, task, ...given }, transfer);
    });
  }

  /** A frame of the camera; onLive hears its light, unless a newer one overtakes it. */
  give({ frame, transfer }, time) {
    this.#worker.postMessage({ task: "frame", frame, time }, transfer);
  }

  /**
   * Open the networks at the first call, and again after one that failed; ?engine= and ?threads= in the page's address
   * have their way.
   */
  open(config) {
    const base = document.baseURI;
    const weights = Object.fromEntries(
      Object.entries(config.weights).map(([stage, path]) => [stage, new URL(path, base).href]),
    );
    const asked = new URLSearchParams(location.search);
    const engine = asked.get("engine");
    const cores = navigator.hardwareConcurrency || 1;
    const threads = Number(asked.get("threads")) || Math.max(cores - this.sparedCores, 1);
    this.#worker ??= this.#begin();
    this.opened ??= this.ask("open", { base, weights, engine, threads }).catch((error) => {
      this.#end();
      throw error;
    });
    return this.opened;
  }
}
