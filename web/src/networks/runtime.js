/** onnxruntime-web in the networks' thread: WASM with threads, or WebGPU where that is asked for. */

/** More threads than this gain nothing on networks of this size. */
const MAX_THREADS = 4;

/** The build with WebGPU waits for the GPU by JSPI, which every browser it is offered to must have. */
const MODULES = { wasm: "ort.wasm.min.mjs", webgpu: "ort.jspi.min.mjs" };

/**
 * @param {Runtime} runtime
 * @param {"wasm" | "webgpu"} engine
 * @param {number} most threads
 * @returns {Promise<{ort: object, threads: number}>}
 * @typedef {string | {module: string, wasm: string}} Runtime address of the folder of onnxruntime-web's files, or of its
 *   module (with the glue in it) and its .wasm for this engine
 */
export async function openRuntime(runtime, engine, most) {
  if (!(engine in MODULES)) throw new Error(`engine: expected wasm or webgpu, got ${engine}`);
  if (engine === "webgpu" && !(await navigator.gpu?.requestAdapter())) {
    throw new Error("engine webgpu: expected a browser with WebGPU, got none; use wasm");
  }
  const isFolder = typeof runtime === "string";
  const ort = await import(/* @vite-ignore */ /* webpackIgnore: true */ isFolder ? runtime + MODULES[engine] : runtime.module);
  // threads share memory, which a browser allows to isolated pages only (COOP and COEP)
  const threads = self.crossOriginIsolated ? Math.min(most, MAX_THREADS) : 1;
  ort.env.wasm.wasmPaths = isFolder ? runtime : { wasm: runtime.wasm };
  ort.env.wasm.numThreads = threads;
  ort.env.logLevel = "error";
  return { ort, threads };
}
