/** The caller's side of the networks' thread: one promise a request. */

export class WorkerClient {
  #worker;
  #waiting = new Map();
  #count = 0;

  /** Hears the lights of a video's frames. */
  onLive = () => {};

  /** Memory of frames that are done with. */
  spares = [];

  /** @param {(progress: {done: number, of: number}) => void} onProgress while networks are opened */
  constructor(onProgress) {
    this.#worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
    this.#worker.onmessage = ({ data }) => {
      if (data.progress) return onProgress(data.progress);
      if (data.live) return this.onLive(data.live);
      if (data.spare) return this.spares.push(data.spare);
      const { resolve, reject } = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if (data.error === undefined) resolve(data.result);
      else reject(new Error(data.error));
    };
    this.#worker.onerror = (event) => this.#failAll(new Error(event.message || "The networks' thread could not be started."));
  }

  /** Ask for a task of worker.js. */
  ask(task, given = {}, transfer = []) {
    const id = this.#count++;
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ id, task, ...given }, transfer);
    });
  }

  /** A frame of a video; onLive hears its light, unless a newer one overtakes it. */
  give({ frame, transfer }, time) {
    this.#worker.postMessage({ task: "frame", frame, time }, transfer);
  }

  end() {
    this.#worker.terminate();
    this.#failAll(new Error("The light probe was disposed of."));
  }

  #failAll(error) {
    for (const { reject } of this.#waiting.values()) reject(error);
    this.#waiting.clear();
  }
}
