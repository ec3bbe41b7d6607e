/**
 * Where the weights and the runtime are: beside this package, as its bundler has them, or as an import map says.
 *
 * A bundler copies what is named by `new URL(..., import.meta.url)` here and rewrites the address.
 */

import { INTEGRITY } from "./integrity.js";

/** Address and hash of each graph. */
export function installedWeights() {
  return {
    light: { url: new URL("../../weights/light.onnx", import.meta.url).href, integrity: INTEGRITY.light },
    mask: { url: new URL("../../weights/mask.onnx", import.meta.url).href, integrity: INTEGRITY.mask },
  };
}

/** The runtime's files where this module is served as it lies in node_modules: plainly, or by a development server. */
const BESIDE = "../../../onnxruntime-web/dist/";

/** @param {"wasm" | "webgpu"} engine @returns {import("./runtime.js").Runtime} */
export function installedRuntime(engine) {
  try {
    return import.meta.resolve("onnxruntime-web/"); // an import map's folder
  } catch {
    if (import.meta.url.includes("/node_modules/anyprobe/src/")) return new URL(BESIDE, import.meta.url).href;
  }
  if (engine === "webgpu") {
    return {
      module: new URL("onnxruntime-web/jspi", import.meta.url).href,
      wasm: new URL("onnxruntime-web/ort-wasm-simd-threaded.jspi.wasm", import.meta.url).href,
    };
  }
  return {
    module: new URL("onnxruntime-web/wasm", import.meta.url).href,
    wasm: new URL("onnxruntime-web/ort-wasm-simd-threaded.wasm", import.meta.url).href,
  };
}
