/** Networks that could not be opened are opened by the next call, and what was not there is named. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { ProbeOpener } from "../page/probe.js";
import { WEIGHTS, integrityOf } from "../build/weights.js";
import { INTEGRITY } from "../src/networks/integrity.js";
import { INPUTS, graphInputs } from "../src/networks/lightGraph.js";
import { Models } from "../src/networks/models.js";

const workers = [];
globalThis.document = { baseURI: "http://localhost/" };
globalThis.location = { search: "" };
Object.defineProperty(globalThis, "navigator", { value: { hardwareConcurrency: 2 } });
globalThis.OffscreenCanvas = globalThis.createImageBitmap = class {};
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
  const opener = new ProbeOpener(config, () => {}, 0);
  const failing = [opener.open(), opener.open()];
  workers[0].onmessage({ data: { id: workers[0].asked[0].id, error: { code: "fetch-failed", text: "not there" } } });
  for (const one of failing) await assert.rejects(one, { name: "AnyProbeError", code: "fetch-failed", message: /not there/ });
  assert.ok(workers[0].isEnded && workers[0].asked.length === 1);
  const { say, weights, runtime, threads } = workers[0].asked[0];
  assert.deepEqual([say, weights.light.url, runtime], ["open", "http://localhost/weights/light.onnx", "http://localhost/ort/"]);
  assert.equal(threads, 2);

  const opening = opener.open();
  workers[1].onerror({}); // its script could not be fetched
  await assert.rejects(opening, /could not be started/);

  const again = opener.open();
  workers[2].onmessage({ data: { id: workers[2].asked[0].id, result: { threads: 3 } } });
  assert.deepEqual([(await again).threads, (await again).hasMask], [3, false]);
  assert.equal(opener.open(), again);
  assert.equal(workers.length, 3);
});

test("a graph that cannot be fetched is named", async () => {
  const ort = { InferenceSession: { create: async (bytes) => ({ bytes, inputNames: INPUTS }) } };
  const weights = { light: { url: "http://localhost/weights/light.onnx?0123" } };
  const { fetch } = globalThis;
  try {
    globalThis.fetch = async () => new Response("gone", { status: 404 });
    await assert.rejects(Models.open(ort, weights), /^AnyProbeError: light\.onnx could not be fetched from http:\/\/localhost\/weights\/light\.onnx\?0123 \(answer 404\)$/);
    globalThis.fetch = async (_, { integrity }) => new Response(integrity);
    const hashed = { light: { ...weights.light, integrity: "sha384-" } };
    assert.deepEqual((await Models.open(ort, hashed)).sessions.light.bytes, new TextEncoder().encode("sha384-"));
    globalThis.fetch = async () => Promise.reject(new TypeError("Failed to fetch"));
    await assert.rejects(Models.open(ort, weights), /^AnyProbeError: light\.onnx could not be fetched from \S+ \(Failed to fetch\)$/);
    globalThis.fetch = async () => new Response(Uint8Array.of(1, 2));
    assert.deepEqual((await Models.open(ort, weights)).sessions.light.bytes, Uint8Array.of(1, 2));
  } finally {
    globalThis.fetch = fetch;
  }
});

test("a graph in another's place is refused where it is opened", async () => {
  const ort = { InferenceSession: { create: async () => ({ inputNames: ["input"] }) } };
  const fault = { name: "AnyProbeError", code: "invalid-option", message: /^weights\.light: expected a graph of photo, .*, got one of input$/ };
  await assert.rejects(Models.open(ort, { light: Uint8Array.of(1) }), fault);
});

test("the hashes are those of the networks that the Python package carries", () => {
  for (const [name, path] of Object.entries(WEIGHTS)) {
    assert.equal(INTEGRITY[name], integrityOf(path), `${name}: npm run weights writes the hashes anew`);
  }
});

test("a graph is fed and read by name, whatever its order", async () => {
  const ort = { Tensor: class { constructor(_, data, dims) { Object.assign(this, { data, dims }); } } };
  const run = async (feeds) => {
    assert.deepEqual(Object.keys(feeds).sort(), [...INPUTS].sort());
    for (const [name, { data, dims }] of Object.entries(feeds)) assert.equal(data.length, dims.reduce((a, b) => a * b), name);
    return { soft: { data: Float32Array.of(0.25) }, radiance: { data: Float32Array.of(1) } };
  };
  const models = new Models(ort, { light: { run } }, "wasm");
  const picture = { width: 1300, height: 9, rgba: new Uint8ClampedArray(4 * 1300 * 9) };
  const found = await models.light(graphInputs(picture, new Float32Array(1300 * 9).fill(1, 0, 5000), 60));
  assert.deepEqual([found.soft[0], found.radiance[0]], [0.25, 1]);
});
