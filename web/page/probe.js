/** The page's probe, opened at the first call and again after a failure. */

import { AnyProbe } from "../src/anyprobe.js";

export class ProbeOpener {
  /**
   * @param {object} config of the page: weights
   * @param {(progress: import("../src/files/download.js").Progress) => void} onProgress while networks are opened
   * @param {number} sparedCores how many the networks leave to others
   */
  constructor(config, onProgress, sparedCores) {
    Object.assign(this, { config, onProgress, sparedCores, opened: null });
  }

  /** ?threads= in the page's address has its way. @returns {Promise<AnyProbe>} */
  open() {
    const at = (path) => new URL(path, document.baseURI).href;
    const spare = Math.max((navigator.hardwareConcurrency || 1) - this.sparedCores, 1);
    const threads = new URLSearchParams(location.search).get("threads") ?? spare;
    this.opened ??= AnyProbe.load({
      threads: Number(threads) || threads,
      weights: Object.fromEntries(Object.entries(this.config.weights).map(([stage, path]) => [stage, at(path)])),
      runtime: at("ort/"),
      worker: () => new Worker(new URL("../src/networks/worker.js", import.meta.url), { type: "module" }),
      onProgress: this.onProgress,
    }).catch((error) => {
      this.opened = null;
      throw error;
    });
    return this.opened;
  }
}
