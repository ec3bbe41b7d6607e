/** Networks that could not be opened are opened by the next call, and what was not there is named. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Networks } from "../src/networks/workerClient.js";
import { Models } from "../src/networks/models.js";

const workers = [];
globalThis.document = { baseURI: "http://localhost/" };
globalThis.location = { search: "" };
Object.defineProperty(globalThis, "navigator", { value: { hardwareConcurrency: 2 } });
globalThis.Worker = class {
  constructor() {
    this.asked = [];
    workers.push(this);
  }
  postMessage(message) {
    this.asked.push(message);
  }
  terminate() {
    this.isEnded = true;
  }
};
const config = { weights: { light: "weights/light.onnx" } };

test("what failed once is tried again, in another thread; what is open stays", async () => {
  const networks = new Networks(() => {}, 0);
  const failing = [networks.open(config), networks.open(config)];
  workers[0].onmessage({ data: { id: workers[0].asked[0].id, error: "not there" } });
  for (const one of failing) await assert.rejects(one, /not there/);
  assert.ok(workers[0].isEnded && workers[0].asked.length === 1);

  const opening = networks.open(config);
  workers[1].onerror({}); // its script could not be fetched
  await assert.rejects(opening, /could not be started/);

  const again = networks.open(config);
  workers[2].onmessage({ data: { id: workers[2].asked[0].id, result: { hasMask: true } } });
  assert.deepEqual(await again, { hasMask: true });
  assert.equal(networks.open(config), again);
  assert.equal(workers.length, 3);
});

test("a graph that cannot be fetched is named", async () => {
  const ort = { InferenceSession: { create: async (bytes) => ({ bytes }) } };
  const weights = { light: "http://localhost/weights/light.onnx?0123" };
  const { fetch } = globalThis;
  try {
    globalThis.fetch = async () => new Response("gone", { status: 404 });
    await assert.rejects(Models.open(ort, weights), /^Error: light\.onnx could not be fetched \(answer 404\)$/);
    globalThis.fetch = async () => Promise.reject(new TypeError("Failed to fetch"));
    await assert.rejects(Models.open(ort, weights), /^Error: light\.onnx could not be fetched \(Failed to fetch\)$/);
    globalThis.fetch = async () => new Response(Uint8Array.of(1, 2));
    assert.deepEqual((await Models.open(ort, weights)).sessions.light.bytes, Uint8Array.of(1, 2));
  } finally {
    globalThis.fetch = fetch;
  }
});
