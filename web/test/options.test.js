/** What is asked for is checked before any work is done. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { download } from "../src/files/download.js";
import { WorkerClient } from "../src/networks/workerClient.js";
import { OPTIONS, checkHints, checkNames, shown } from "../src/checks.js";
import { rotationOfPose } from "../src/live/pose.js";
import { lensOf } from "../src/photo/lens.js";

const refused = { name: "AnyProbeError", code: "invalid-option" };
const longFovOf = (given, width, height) => lensOf(given, { width, height }).longFovDeg;
const degrees = (radians) => (radians * 180) / Math.PI;

/** A perspective camera's matrix, column by column, as three.js's PerspectiveCamera has it. */
function projection(fovDeg, aspect, offCentre = 0) {
  const down = 1 / Math.tan((fovDeg * Math.PI) / 360);
  return [down / aspect, 0, 0, 0, 0, down, 0, 0, offCentre, 0, -1.002, -1, 0, 0, -0.2, 0];
}

test("names that there are not are refused, in every method", () => {
  for (const method of Object.keys(OPTIONS)) {
    checkNames(method, undefined);
    checkNames(method, Object.fromEntries(OPTIONS[method].map((name) => [name, undefined])));
    assert.throws(() => checkNames(method, { clik: [1, 2] }), { ...refused, message: /unknown option clik; expected of/ });
    assert.throws(() => checkNames(method, null), refused);
  }
  assert.throws(() => checkNames("track", { clik: [1, 2] }), (error) => !error.message.includes("onOutline"));
  checkNames("track", { onOutline: () => {} }); // of the package's page
});

test("the vertical angle is three.js's, whichever side is the longer", () => {
  assert.ok(Math.abs(longFovOf({ fovDeg: 40 }, 300, 400) - 40) < 1e-9);
  const wide = degrees(2 * Math.atan(2 * Math.tan((20 * Math.PI) / 180)));
  assert.ok(Math.abs(longFovOf({ fovDeg: 40 }, 800, 400) - wide) < 1e-9);
  assert.equal(longFovOf({ longFovDeg: 40 }, 800, 400), 40);
  assert.equal(longFovOf({}, 800, 400), 60);
  for (const [width, height] of [[800, 400], [300, 400]]) {
    const elements = projection(40, width / height);
    const expected = longFovOf({ fovDeg: 40 }, width, height);
    assert.ok(Math.abs(longFovOf({ projectionMatrix: { elements } }, width, height) - expected) < 1e-9);
    assert.ok(Math.abs(longFovOf({ projectionMatrix: new Float32Array(elements) }, width, height) - expected) < 1e-4);
  }
});

test("lenses that no picture has are refused", () => {
  for (const fovDeg of [0, 190, NaN, "40", -10, 179]) assert.throws(() => longFovOf({ fovDeg }, 400, 300), refused);
  assert.throws(() => longFovOf({ fovDeg: 40, longFovDeg: 40 }, 4, 3), { ...refused, message: /one of fovDeg, longFovDeg/ });
  const matrices = [[], [1, 2], null, projection(40, 2), projection(40, 4 / 3, 0.3), new Array(16).fill(NaN), new Array(16).fill(1)];
  for (const projectionMatrix of matrices) assert.throws(() => longFovOf({ projectionMatrix }, 400, 300), refused);
});

test("clicks and boxes are pairs and fours of numbers in the picture", () => {
  for (const fine of [{}, { click: [0, 0] }, { click: [[1, 2], [300, 400]], exclude: [] }, { box: [0, 0, 300, 400] }, { box: null }]) checkHints(fine, 300, 400);
  const wrong = [{ click: [1] }, { click: "1,2" }, { click: [{ x: 1, y: 2 }] }, { click: { x: 1, y: 2 } }, { exclude: [[1, NaN]] }, { click: [310, 0] }];
  const boxes = [[1, 2, 3], [9, 9, 3, 12], [0, 0, 400, 400], "0,0,9,9"].map((box) => ({ box }));
  for (const given of [...wrong, ...boxes]) assert.throws(() => checkHints(given, 300, 400), refused, JSON.stringify(given));
});

test("kinds of light are those there are", () => {
  for (const surroundings of ["auto", "photo", "none", true, false]) checkNames("tracker.set", { surroundings, pitchDeg: 20 });
  assert.throws(() => checkNames("tracker.set", { surroundings: "yes" }), refused);
  for (const pitchDeg of [91, NaN, "20"]) assert.throws(() => checkNames("tracker.set", { pitchDeg }), refused, String(pitchDeg));
});

/** A thread that answers when told to. */
function thread() {
  const heard = [];
  const worker = { heard, terminate: () => (worker.isEnded = true), postMessage: (message) => heard.push(message) };
  return worker;
}

test("what is asked of a thread settles, however it ends", async () => {
  const worker = thread();
  const client = new WorkerClient(() => worker, () => {});
  const asked = [client.ask("estimate"), client.ask("mask")];
  worker.onmessage({ data: { id: 0, error: { code: "no-object", text: "none" } } });
  await assert.rejects(asked[0], { code: "no-object", message: "none" });
  client.end();
  await assert.rejects(asked[1], { code: "disposed" });
  await assert.rejects(client.ask("estimate"), { code: "disposed" });
  assert.throws(() => client.check(), { code: "disposed" });
  assert.ok(worker.isEnded && worker.heard.length === 2);

  const broken = thread();
  const other = new WorkerClient(() => broken, () => {});
  const waiting = other.ask("open");
  broken.onerror({});
  await assert.rejects(waiting, { code: "worker-failed", message: /anyprobe\/core/ });
  await assert.rejects(other.ask("estimate"), { code: "worker-failed" });
});

test("a request that is given up rejects with its signal's reason, and its answer is nobody's", async () => {
  const worker = thread();
  const client = new WorkerClient(() => worker, () => {});
  await assert.rejects(client.ask("mask", {}, AbortSignal.abort("early")), (error) => error === "early");
  assert.equal(worker.heard.length, 0);
  const ending = new AbortController();
  const asked = client.ask("mask", {}, ending.signal);
  ending.abort(new Error("late"));
  await assert.rejects(asked, /late/);
  assert.deepEqual(worker.heard.at(-1), { giveUp: 0 });
  worker.onmessage({ data: { id: 0, result: 1 } });
});

test("a download says how much has come, and when nothing comes", async () => {
  const { fetch } = globalThis;
  const said = [];
  try {
    let send;
    const body = new ReadableStream({ start: (controller) => (send = controller) });
    globalThis.fetch = async (_, { signal }) => {
      signal.addEventListener("abort", () => send.error(signal.reason));
      return new Response(body, { headers: { "content-length": "10" } });
    };
    const coming = download("https://localhost/a/light.onnx?1", { onProgress: (one) => said.push(one), stalledMs: 20, givenUpMs: 60 });
    send.enqueue(new Uint8Array(4));
    await assert.rejects(coming, { code: "fetch-failed", message: /light\.onnx could not be fetched from https:\/\/localhost\/a\/light\.onnx\?1 \(no data for 0\.06 s after 4 bytes\)/ });
  } finally {
    globalThis.fetch = fetch;
  }
  const about = { file: "light.onnx", loaded: 4, total: 10 };
  assert.deepEqual(said, [{ ...about, stalled: false }, { ...about, stalled: true }]);
});

test("a browser that lacks what is needed is told which it is, and Node.js that it is none", async () => {
  const { AnyProbe } = await import("../src/plain.js");
  const lacking = globalThis.Worker === undefined ? /^expected a browser, got Node\.js; load it in the page/ : /no OffscreenCanvas, which anyprobe needs/;
  await assert.rejects(AnyProbe.load(), { code: "unsupported", message: lacking });
  globalThis.Worker = globalThis.OffscreenCanvas = class {};
  await assert.rejects(AnyProbe.load(), { code: "unsupported", message: /no createImageBitmap, which anyprobe needs; use a newer one$/ });
  globalThis.createImageBitmap = () => {};
  for (const wrong of [{ threads: 0 }, { threads: "2" }, { engine: "webgpu" }, { onProgress: 3 }, { signal: {} }, { weights: 3 }, { weights: { light: 3 } }, { runtime: {} }, { worker: 3 }]) {
    await assert.rejects(AnyProbe.load(wrong), refused, JSON.stringify(wrong));
  }
});

test("a camera's pose is read from matrices by columns, from a transform, and from nine numbers by rows", () => {
  const rows = [0, 0, 1, 0, 1, 0, -1, 0, 0]; // a quarter turn to the left
  const matrix = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 5, 6, 7, 1];
  for (const pose of [rows, matrix, { elements: matrix }, { matrix }, { matrixWorld: { elements: matrix } }]) {
    assert.deepEqual(rotationOfPose(pose), rows);
  }
  const wrong = [matrix.map((value) => 2 * value), [1, 0, 0, 0, 1, 0, 0, 0, -1], [1, 2, 3], new Array(16).fill(NaN)];
  for (const pose of wrong) assert.throws(() => rotationOfPose(pose), { code: "invalid-option", message: /^pose: expected/ });
});

test("whatever was given is said in one short line", () => {
  const itself = {};
  itself.self = itself;
  const said = [NaN, [1, Infinity], new Float32Array(3), new ArrayBuffer(8), new Map(), itself, 10n, { a: "b" }, null, undefined, "x"].map(shown);
  assert.deepEqual(said, ["NaN", "[1,\"Infinity\"]", "Float32Array of 3", "ArrayBuffer", "Map", "an object that contains itself", "10", "{\"a\":\"b\"}", "null", "undefined", "\"x\""]);
});

test("a thread that cannot be begun is told of", () => {
  const load = (start) => () => new WorkerClient(start, () => {});
  assert.throws(load(() => undefined), { ...refused, message: "worker: expected a function that gives a Worker, got undefined" });
  const blocked = () => {
    throw new DOMException("not of this origin.", "SecurityError");
  };
  assert.throws(load(blocked), { code: "worker-failed", message: "The networks' thread could not be started: not of this origin." });
});

test("a thread that ends is heard of by what follows a video", () => {
  const worker = { postMessage: () => {}, terminate: () => {} };
  const client = new WorkerClient(() => worker, () => {});
  const heard = [];
  client.onLive = (answer) => heard.push(answer.error);
  worker.onmessage({ data: { spare: new ArrayBuffer(1) } });
  worker.onerror({ message: "out of memory" });
  assert.deepEqual(heard, [{ code: "worker-failed", subject: [], text: "The networks' thread ended: out of memory.", remedy: [] }]);
});
