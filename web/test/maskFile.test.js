/** The better mask network is fetched once, from the caller's address alone, and its bytes are checked. */

import assert from "node:assert/strict";
import { afterEach, test } from "node:test";

import { AnyProbe } from "../src/anyprobe.js";

const ADDRESS = "https://example.org/u2netp.onnx";
const [caches, fetch] = [globalThis.caches, globalThis.fetch];

afterEach(() => Object.assign(globalThis, { caches, fetch }));

/** A browser's cache, and a network that answers with these bytes. */
function begin(bytes) {
  const [kept, asked] = [new Map(), []];
  const cache = { match: async (url) => kept.get(url)?.clone(), put: async (url, answer) => void kept.set(url, answer) };
  globalThis.caches = { open: async () => cache };
  globalThis.fetch = async (url, { integrity }) => {
    asked.push({ url, integrity });
    return new Response(bytes);
  };
  return asked;
}

test("it is fetched once, with its hash", async () => {
  const asked = begin(Uint8Array.of(1, 2, 3));
  for (let turn = 0; turn < 2; turn++) assert.deepEqual(await AnyProbe.fetchMaskNetwork(ADDRESS), Uint8Array.of(1, 2, 3));
  assert.equal(asked.length, 1);
  assert.deepEqual([asked[0].url, asked[0].integrity.slice(0, 7)], [ADDRESS, "sha384-"]);
});

test("without a cache it is fetched too, and there is no address of its own", async () => {
  begin(Uint8Array.of(4));
  globalThis.caches = undefined;
  assert.deepEqual(await AnyProbe.fetchMaskNetwork(ADDRESS), Uint8Array.of(4));
  await assert.rejects(AnyProbe.fetchMaskNetwork(), { code: "invalid-option" });
  await assert.rejects(AnyProbe.fetchMaskNetwork(ADDRESS, { progress: () => {} }), { code: "invalid-option" });
});
