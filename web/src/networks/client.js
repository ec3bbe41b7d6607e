/** The page's side of the networks' thread: one promise a request. */

export class Networks {
  #worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
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
    this.#worker.onmessage = ({ data }) => {
      if (data.progress) return onProgress(data.progress);
      if (data.live) return this.onLive(data.live);
      if (data.spare) return this.spares.push(data.spare);
      const { resolve, reject } = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if (data.error === undefined) resolve(data.result);
      else reject(new Error(data.error));
    };
    this.#worker.onerror = (event) => {
      const error = new Error(event.message || "The networks' thread could not be started.");
      for (const { reject } of this.#waiting.values()) reject(error);
      this.#waiting.clear();
    };
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

  /** Open the networks once, at the first call; ?engine= and ?threads= in the page's address have their way. */
  open(config) {
    const base = document.baseURI;
    const weights = Object.fromEntries(
      Object.entries(config.weights).map(([stage, path]) => [stage, new URL(path, base).href]),
    );
    const asked = new URLSearchParams(location.search);
    const engine = asked.get("engine");
    const cores = navigator.hardwareConcurrency || 1;
    const threads = Number(asked.get("threads")) || Math.max(cores - this.sparedCores, 1);
    this.opened ??= this.ask("open", { base, weights, engine, threads });
    return this.opened;
  }
}
