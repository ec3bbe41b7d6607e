/** What a probe is opened with, checked before its thread is started; addresses are of the page, not of the thread. */

import { AnyProbeError } from "../errors.js";
import { wrong } from "../checks.js";

/** Refuse what lacks what is needed: Node.js, and browsers of before 2023. */
export function requireBrowser() {
  const missing = ["Worker", "WebAssembly", "OffscreenCanvas", "createImageBitmap"].find((name) => typeof globalThis[name] === "undefined");
  if (!missing) return;
  if (missing === "Worker" && globalThis.process?.versions?.node) throw new AnyProbeError("unsupported", "expected a browser, got Node.js; load it in the page, or use the Python package there");
  throw new AnyProbeError("unsupported", `this browser has no ${missing}, which anyprobe needs; use a newer one`);
}

/** @param {import("../../types/index.d.ts").LoadOptions} options @param {object} files an entry's own, where options say nothing */
export function checkSetup({ threads, onProgress = () => {}, ...options }, files) {
  const least = threads ?? (globalThis.navigator?.hardwareConcurrency || 1);
  if (!(Number.isInteger(least) && least >= 1)) throw wrong("threads", "a whole number from 1 on", threads);
  return {
    threads: least,
    onProgress,
    worker: starterOf(options.worker ?? files.worker),
    weights: weightsOf(options.weights, files.weights),
    runtime: runtimeOf(options.runtime ?? files.runtime),
  };
}

function starterOf(worker) {
  if (typeof worker === "function") return worker;
  if (typeof worker === "string" || worker instanceof URL) {
    const address = absolute(worker);
    return Object.assign(() => new Worker(address, { type: "module" }), { address });
  }
  throw wrong("worker", "a function that starts it, or its address", worker);
}

const GRAPHS = ["light", "mask", "u2netp"];

/** What is given in the place of the entry's own graphs, or beside them. */
function weightsOf(given = {}, own = {}) {
  if (given === null || typeof given !== "object") throw wrong("weights", "an object with the address of each graph", given);
  const names = Object.keys(given).filter((name) => given[name] !== undefined);
  const unknown = names.filter((name) => !GRAPHS.includes(name));
  if (unknown.length) throw new AnyProbeError("invalid-option", `expected of ${GRAPHS.join(", ")}, got ${unknown.join(", ")}`, { subject: ["weights"] });
  const weights = { ...own };
  for (const name of names) weights[name] = given[name];
  if (!weights.light) throw new AnyProbeError("invalid-option", `expected light, got ${names.join(", ") || "none"}`, { subject: ["weights"] });
  return Object.fromEntries(Object.entries(weights).map(([name, graph]) => [name, graphOf(name, graph)]));
}

function graphOf(name, graph) {
  if (graph instanceof Uint8Array) return graph;
  if (typeof graph === "string" || graph instanceof URL) return { url: absolute(graph) };
  if (typeof graph?.url === "string") return { ...graph, url: absolute(graph.url) };
  throw wrong(`weights.${name}`, "an address, { url, integrity } or bytes", graph);
}

function runtimeOf(runtime) {
  if (typeof runtime === "string" || runtime instanceof URL) {
    const folder = absolute(runtime);
    return folder.endsWith("/") ? folder : `${folder}/`;
  }
  const keys = ["module", "glue", "wasm"].filter((key) => runtime?.[key] !== undefined);
  if (!keys.includes("wasm") || keys.length < 2) {
    throw wrong("runtime", "the address of onnxruntime-web's folder dist/, or { module, wasm }", runtime);
  }
  return Object.fromEntries(keys.map((key) => [key, absolute(runtime[key])]));
}

/** An address in full. @param {string | URL} address */
export function absolute(address) {
  try {
    return new URL(address, globalThis.document?.baseURI ?? globalThis.location?.href).href;
  } catch {
    throw wrong("address", "one of a file", String(address));
  }
}
