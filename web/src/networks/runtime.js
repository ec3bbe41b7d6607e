/** onnxruntime-web in the networks' thread: WASM, with threads where the page allows them. */

import { AnyProbeError } from "../errors.js";
import { download } from "../files/download.js";

/** More threads than this gain nothing on networks of this size. */
const MAX_THREADS = 4;

/** In the folder of onnxruntime-web's files. */
const [MODULE, BINARY] = ["ort.wasm.min.mjs", "ort-wasm-simd-threaded.wasm"];

/** Threads that have not started after so long never do; only their start counts, not what is fetched. */
const START_MS = 20_000;

let bundled = null;

/** The runtime's module, where a bundler put it into this thread. */
export function provideRuntime(ort) {
  bundled = ort;
}

/**
 * @param {Runtime} runtime
 * @param {number} most threads
 * @param {(progress: import("../files/download.js").Progress) => void} onProgress
 * @returns {Promise<{ort: object, threads: number}>}
 * @typedef {string | {module: string, wasm: string} | {glue: string, wasm: string}} Runtime address of the folder of
 *   onnxruntime-web's files; or of its module with the glue in it, and its .wasm; or where the module is bundled of its
 *   glue and its .wasm
 */
export async function openRuntime(runtime, most, onProgress) {
  const isFolder = typeof runtime === "string";
  const fetching = download(isFolder ? runtime + BINARY : runtime.wasm, { onProgress });
  fetching.catch(() => {}); // thrown where it is awaited
  const ort = await moduleOf(runtime);
  // threads share memory, which a browser allows to isolated pages only (COOP and COEP)
  const threads = self.crossOriginIsolated ? Math.min(most, MAX_THREADS) : 1;
  ort.env.wasm.wasmPaths = isFolder ? runtime : { wasm: runtime.wasm, mjs: runtime.glue };
  ort.env.wasm.wasmBinary = await fetching;
  ort.env.wasm.numThreads = threads;
  ort.env.wasm.initTimeout = threads > 1 ? START_MS : 0;
  ort.env.logLevel = "error";
  return { ort, threads };
}

async function moduleOf(runtime) {
  const url = typeof runtime === "string" ? runtime + MODULE : runtime.module;
  if (bundled && (typeof runtime === "string" || !url)) return bundled;
  try {
    return await import(/* @vite-ignore */ /* webpackIgnore: true */ /* turbopackIgnore: true */ url);
  } catch (error) {
    throw new AnyProbeError("fetch-failed", `the runtime could not be fetched from ${url} (${error.message})`);
  }
}
