/** Files that a bundler copies: each is named by `new URL(..., import.meta.url)` as it stands here, which Vite, webpack and Turbopack read. */

import { weightFiles } from "./weightFiles.js";

export function filesForWasm() {
  return {
    engines: ["wasm"],
    weights: weightFiles(),
    runtime: {
      glue: new URL("onnxruntime-web/ort-wasm-simd-threaded.mjs", import.meta.url).href,
      wasm: new URL("onnxruntime-web/ort-wasm-simd-threaded.wasm", import.meta.url).href,
    },
    worker: () => new Worker(new URL("./wasmWorker.js", import.meta.url), { type: "module" }),
  };
}
