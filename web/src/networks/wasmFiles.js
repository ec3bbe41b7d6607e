/** Files that a bundler copies: each is named by `new URL(..., import.meta.url)` as it stands here, which Vite, webpack and Turbopack read. */

import { INTEGRITY } from "./integrity.js";

export function filesForWasm() {
  return {
    weights: {
      light: { url: new URL("../../weights/light.onnx", import.meta.url).href, integrity: INTEGRITY.light },
      mask: { url: new URL("../../weights/mask.onnx", import.meta.url).href, integrity: INTEGRITY.mask },
    },
    runtime: {
      glue: new URL("onnxruntime-web/ort-wasm-simd-threaded.mjs", import.meta.url).href,
      wasm: new URL("onnxruntime-web/ort-wasm-simd-threaded.wasm", import.meta.url).href,
    },
    worker: () => new Worker(new URL("./wasmWorker.js", import.meta.url), { type: "module" }),
  };
}
