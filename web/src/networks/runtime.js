/** onnxruntime-web, served beside the page: WASM with threads, or WebGPU where that is asked for. */

/** More threads than this gain nothing on networks of this size. */
const MAX_THREADS = 4;

/** The build with WebGPU waits for the GPU by JSPI, which every browser it is offered to must have. */
const MODULES = { wasm: "ort.wasm.min.mjs", webgpu: "ort.jspi.min.mjs" };

/**
 * Which engine: WASM, unless WebGPU is asked for. The graph that ships computes in whole numbers of 8 bits, made for
 * processors; it has not been measured on a GPU.
 *
 * @param {string | null} asked "wasm" or "webgpu"; null chooses
 * @returns {string}
 */
export function chooseEngine(asked) {
  return asked in MODULES ? asked : "wasm";
}

/**
 * @param {string} base address of the page's folder
 * @param {string} engine "wasm" or "webgpu"
 * @param {number} most threads
 * @returns {Promise<{ort: object, threads: number}>}
 */
export async function openRuntime(base, engine, most) {
  const folder = new URL("ort/", base).href;
  const ort = await import(/* @vite-ignore */ `${folder}${MODULES[engine]}`);
  // threads share memory, which a browser allows to isolated pages only (COOP and COEP)
  const threads = self.crossOriginIsolated ? Math.min(most, MAX_THREADS) : 1;
  ort.env.wasm.wasmPaths = folder;
  ort.env.wasm.numThreads = threads;
  ort.env.logLevel = "error";
  return { ort, threads };
}
