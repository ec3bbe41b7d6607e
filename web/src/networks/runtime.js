/** onnxruntime-web, served beside the page: WebGPU where there is one, else WASM with all threads allowed. */

/** More threads than this gain nothing on networks of this size. */
const MAX_THREADS = 4;

/**
 * @param {string} base address of the page's folder
 * @returns {Promise<{ort: object, providers: string[], threads: number}>}
 */
export async function openRuntime(base) {
  const folder = new URL("ort/", base).href;
  const ort = await import(/* @vite-ignore */ `${folder}ort.wasm.min.mjs`);
  // threads share memory, which a browser allows to isolated pages only (COOP and COEP)
  const threads = self.crossOriginIsolated ? Math.min(navigator.hardwareConcurrency || 1, MAX_THREADS) : 1;
  ort.env.wasm.wasmPaths = folder;
  ort.env.wasm.numThreads = threads;
  ort.env.logLevel = "error";
  return { ort, providers: ["wasm"], threads };
}
