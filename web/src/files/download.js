/** Download a file with progress; a stalled download is reported, then given up. */

import { AnyProbeError } from "../errors.js";

/** Time without a byte after which a download counts as stalled, and after which it is given up. */
const [STALLED_MS, GIVEN_UP_MS] = [10_000, 60_000];

/**
 * @param {string} url
 * @param {{integrity?: string, onProgress?: (progress: Progress) => void, stalledMs?: number, givenUpMs?: number}} [options]
 * @returns {Promise<Uint8Array>}
 * @typedef {{file: string, loaded: number, total: number | null, stalled: boolean}} Progress bytes; total is null where the
 *   server does not say it
 */
export async function download(url, { integrity, onProgress = () => {}, stalledMs = STALLED_MS, givenUpMs = GIVEN_UP_MS } = {}) {
  const file = url.split(/[?#]/)[0].split("/").at(-1);
  const ending = new AbortController();
  let [loaded, total] = [0, null];
  const timers = [];
  const heard = () => {
    timers.splice(0).forEach(clearTimeout);
    timers.push(setTimeout(() => onProgress({ file, loaded, total, stalled: true }), stalledMs));
    timers.push(setTimeout(() => ending.abort(new Error(`no data for ${givenUpMs / 1000} s after ${loaded} bytes`)), givenUpMs));
  };
  heard();
  try {
    const answer = await ask(url, integrity, ending.signal);
    const isPlain = !answer.headers.get("content-encoding"); // else its length is not that of what comes
    total = (isPlain && Number(answer.headers.get("content-length"))) || null;
    const parts = [];
    for (const reader = answer.body.getReader(); ; ) {
      const { done, value } = await reader.read();
      if (done) break;
      parts.push(value);
      loaded += value.length;
      onProgress({ file, loaded, total, stalled: false });
      heard();
    }
    return new Uint8Array(await new Blob(parts).arrayBuffer());
  } catch (error) {
    throw new AnyProbeError("fetch-failed", `${file} could not be fetched from ${url} (${error.message})`);
  } finally {
    timers.forEach(clearTimeout);
  }
}

/** Given a hash, a browser rejects without telling the status: the file is requested again to learn why. */
async function ask(url, integrity, signal) {
  try {
    return checkAnswer(await fetch(url, { integrity, signal }));
  } catch (error) {
    if (!integrity || !(error instanceof TypeError)) throw error;
    const answer = await fetch(url, { signal }).catch(() => null);
    if (!answer) throw error;
    await answer.body?.cancel();
    checkAnswer(answer);
    throw new Error(`its hash is not ${integrity}`);
  }
}

function checkAnswer(answer) {
  if (!answer.ok) throw new Error(`answer ${answer.status}`);
  const kind = answer.headers.get("content-type") ?? "";
  if (kind.startsWith("text/html")) throw new Error("an HTML page came in its place; check the address");
  return answer;
}
