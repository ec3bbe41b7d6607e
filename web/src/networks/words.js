/** What the networks' thread says in words: of masks, and of networks that did not open. */

import { AnyProbeError } from "../errors.js";
import { give, notice } from "../notices.js";

/** As Chromium, Firefox and Safari call it. */
const IMPORT_FAULT = /dynamically imported module|importing a module script failed|\.wasm could not be fetched .*an HTML page/i;
export const VITE_NEEDS = 'Vite\'s development server needs optimizeDeps: { exclude: ["anyprobe"] }';

/** Code, within this package, of networks that did not open on several threads: they are opened again on one. */
export const THREADS_FAILED = "threads-failed";

/**
 * @param {Error & {code?: string}} error
 * @param {number} [threads] that the runtime was to start
 * @param {boolean} [isBundled] whether a bundler was to copy the runtime's files, which may be Vite
 */
export function openingFault(error, threads = 1, isBundled = true) {
  if (threads > 1 && error.code === undefined) return new AnyProbeError(THREADS_FAILED, String(error.message ?? error));
  const said = String(error.message ?? error).replace(/\.$/, "");
  const advice = isBundled && IMPORT_FAULT.test(said) ? `; ${VITE_NEEDS}` : "";
  return new AnyProbeError(error.code ?? "failed", `The networks could not be opened: ${said}${advice}.`);
}

/** In the package, and on a page that a server gives. */
const GET_MASKS = [
  { do: "give", name: "weights.u2netp", value: "await AnyProbe.fetchMaskNetwork(address)" },
  { do: "run", name: "fetch-masks" },
];

/** Of masks of the network that learned from renders alone. @param {import("../photo/picture.js").Hints} hints */
export function smallNetworkWarning({ on, box }) {
  const isMarked = on.length > 0 || Boolean(box);
  const text = "the mask was found by the small network, which is wrong on one photo in three";
  return notice("small-network", text, GET_MASKS.concat(give(...(isMarked ? ["mask"] : ["click", "box", "mask"]))));
}
