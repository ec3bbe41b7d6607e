/** U2-Net-p, the better mask network, from an address of the caller's; kept in the browser's cache. */

import { download } from "../files/download.js";
import { absolute } from "./setup.js";

const INTEGRITY = "sha384-UpjzLoU+lZEVpKFraDciVxXXwOeulVBvJo0I/V2HCFa+3IfH/NVWG+LnDKlaZDM4";
const CACHE = "anyprobe";

/**
 * @param {string | URL} address
 * @param {{onProgress?: (progress: import("../files/download.js").Progress) => void}} [options]
 * @returns {Promise<Uint8Array>}
 */
export async function fetchMaskNetwork(address, { onProgress } = {}) {
  const url = absolute(address);
  const cache = await globalThis.caches?.open(CACHE).catch(() => null); // none on an insecure page, or where storage is off
  const kept = await cache?.match(url);
  if (kept) return new Uint8Array(await kept.arrayBuffer());
  const bytes = await download(url, { integrity: INTEGRITY, onProgress });
  await cache?.put(url, new Response(bytes)).catch(() => {}); // the disk may be full
  return bytes;
}
