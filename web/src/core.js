/** anyprobe/core: names no file. The caller gives the addresses of weights and runtime; the worker is text in this package. */

import { AnyProbe as Core } from "./anyprobe.js";
import source from "../dist/workerSource.js";

export * from "./exports.js";

export class AnyProbe extends Core {
  /** @param {import("../types/core.d.ts").CoreLoadOptions} options */
  static load(options) {
    return super.load(options, { worker: startInlined });
  }
}

/** A page with a content security policy allows it by `worker-src blob:`, or gives `worker`. */
function startInlined() {
  const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
  const worker = new Worker(url, { type: "module" });
  worker.addEventListener("message", () => URL.revokeObjectURL(url), { once: true });
  return worker;
}
