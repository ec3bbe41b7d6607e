/** As wasmFiles.js, of the runtime with WebGPU, which waits for the GPU by JSPI. */

import { weightFiles } from "./weightFiles.js";

export function filesForWebgpu() {
  return {
    engines: ["webgpu"],
    weights: weightFiles(),
    runtime: {
      glue: new URL("onnxruntime-web/ort-wasm-simd-threaded.jspi.mjs", import.meta.url).href,
      wasm: new URL("onnxruntime-web/ort-wasm-simd-threaded.jspi.wasm", import.meta.url).href,
    },
    worker: () => new Worker(new URL("./webgpuWorker.js", import.meta.url), { type: "module" }),
  };
}
