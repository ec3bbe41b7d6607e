/** anyprobe without a bundler, for an import map: every file where it lies in the folder that npm made. */

import { AnyProbe as Core } from "./anyprobe.js";
import { INTEGRITY } from "./networks/integrity.js";

export * from "./exports.js";

export class AnyProbe extends Core {
  /** @param {import("../types/index.d.ts").LoadOptions} [options] */
  static load(options) {
    const beside = (path) => new URL(path, import.meta.url).href;
    const graph = (name) => ({ url: beside(`../weights/${name}.onnx`), integrity: INTEGRITY[name] });
    return super.load(options, {
      weights: { light: graph("light"), mask: graph("mask") },
      runtime: runtimeFolder() ?? beside("../../onnxruntime-web/dist/"),
      worker: () => new Worker(beside("./networks/worker.js"), { type: "module" }),
    });
  }
}

/** Where an import map has `onnxruntime-web/`, or null. */
function runtimeFolder() {
  try {
    return import.meta.resolve("onnxruntime-web/");
  } catch {
    return null;
  }
}
