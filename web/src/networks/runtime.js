/** onnxruntime-web, served beside the page: on the GPU where WebGPU reaches one, else WASM with threads. */

/** More threads than this gain nothing on networks of this size. */
const MAX_THREADS = 4;

/** The build with WebGPU waits for the GPU by JSPI, which every browser it is offered to must have. */
const MODULES = { wasm: "ort.wasm.min.mjs", webgpu: "ort.jspi.min.mjs" };

/**
 * Which engines to try, best first.
 *
 * @param {string | null} asked "wasm" or "webgpu" to have that one alone; null chooses
 * @returns {Promise<string[]>}
 */
export async function chooseEngines(asked) {
  if (asked in MODULES) return [asked];
  if (typeof WebAssembly.Suspending !== "function") return ["wasm"];
  const adapter = await navigator.gpu?.requestAdapter().catch(() => null);
  const isReal = adapter && !(adapter.info?.isFallbackAdapter ?? adapter.isFallbackAdapter);
  return isReal ? ["webgpu", "wasm"] : ["wasm"];
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
