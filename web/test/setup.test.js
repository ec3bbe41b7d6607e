/** Networks of one's own beside an entry's, what cannot be fetched, and what is said of both. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { download } from "../src/files/download.js";
import { AnyProbe } from "../src/anyprobe.js";
import { checkSetup } from "../src/networks/setup.js";
import { sentError } from "../src/errors.js";
import { openingFault, smallNetworkWarning } from "../src/networks/words.js";

const refused = (message) => ({ name: "AnyProbeError", code: "invalid-option", message });
globalThis.document = { baseURI: "http://localhost/" };

const others = { runtime: "/ort/", worker: () => {} };
const OWN = { light: "/own/light.onnx", mask: "/own/mask.onnx" };
const urlsOf = (weights, own) => {
  const found = checkSetup({ ...others, weights }, { weights: own }).weights;
  return Object.fromEntries(Object.entries(found).map(([name, { url }]) => [name, url.replace("http://localhost", "")]));
};

test("weights that are given stand beside the entry's own, and in their place", () => {
  assert.deepEqual(urlsOf(undefined, OWN), OWN);
  assert.deepEqual(urlsOf({ u2netp: "/u2netp.onnx" }, OWN), { ...OWN, u2netp: "/u2netp.onnx" });
  assert.deepEqual(urlsOf({ mask: "/m.onnx", u2netp: undefined }, OWN), { ...OWN, mask: "/m.onnx" });
});

test("what is no address is told of", () => {
  assert.throws(() => checkSetup({ ...others, runtime: "http://[", weights: OWN }, {}), refused('address: expected one of a file, got "http://["'));
});

test("a light of one's own takes the entry's place", () => {
  assert.deepEqual(urlsOf({ light: "/l.onnx" }, OWN), { light: "/l.onnx", mask: OWN.mask });
});

test("without an entry's own a light is needed, and names are those there are", () => {
  const line = "weights: expected light, got ";
  assert.throws(() => urlsOf({ u2netp: "/u.onnx" }), refused(`${line}u2netp`));
  assert.throws(() => urlsOf(undefined), refused(`${line}none`));
  assert.throws(() => urlsOf({ u2net: "/u.onnx" }, OWN), refused(/^weights: expected of light, .*, got u2net$/));
  for (const wrong of [null, 3]) assert.throws(() => urlsOf(wrong, OWN), refused(/^weights: expected an object/));
});

test("an object that was marked is not to be marked", () => {
  const names = (hints) => smallNetworkWarning(hints).remedy.map(({ name }) => name);
  assert.deepEqual(names({ on: [], off: [], box: null }), ["weights.u2netp", "fetch-masks", "click", "box", "mask"]);
  for (const hints of [{ on: [[1, 2]], off: [] }, { on: [], off: [], box: [0, 0, 9, 9] }]) {
    assert.deepEqual(names(hints), ["weights.u2netp", "fetch-masks", "mask"]);
  }
});

test("what did not open is said once, with what to do where that is known", () => {
  const line = (message) => openingFault(Object.assign(new Error(message), { code: "fetch-failed" })).message;
  assert.equal(line("light.onnx is gone."), "The networks could not be opened: light.onnx is gone.");
  assert.equal(openingFault(new Error("odd")).code, "failed");
  for (const why of ["Failed to fetch dynamically imported module: a.mjs", "Importing a module script failed."]) {
    assert.match(line(why), /[^.]; Vite's development server needs optimizeDeps: { exclude: \["anyprobe"\] }\.$/);
  }
});

test("a file that is not the one expected says why, though its hash is checked before its status is told", async () => {
  const { fetch } = globalThis;
  const url = "http://localhost/w/light.onnx";
  const why = async (answer, integrity) => {
    globalThis.fetch = async (_, given) => {
      if (given.integrity) throw new TypeError("Failed to fetch");
      return answer();
    };
    const said = await download(url, { integrity }).catch(({ code, message }) => `${code}: ${message}`);
    return said.replace(`fetch-failed: light.onnx could not be fetched from ${url} `, "");
  };
  const page = () => new Response("<html>", { headers: { "content-type": "text/html; charset=utf-8" } });
  try {
    for (const integrity of [undefined, "sha384-abc"]) {
      assert.equal(await why(() => new Response("", { status: 404 }), integrity), "(answer 404)");
      assert.equal(await why(page, integrity), "(an HTML page came in its place; check the address)");
    }
    assert.equal(await why(() => new Response("x"), "sha384-abc"), "(its hash is not sha384-abc)");
    assert.equal(await why(() => Promise.reject(new TypeError("Failed to fetch")), "sha384-abc"), "(Failed to fetch)");
  } finally {
    globalThis.fetch = fetch;
  }
});

/** What a browser has that anyprobe needs, and its user agent; returned: what puts all back. */
function asBrowser(userAgent) {
  const names = ["Worker", "OffscreenCanvas", "createImageBitmap", "navigator"];
  const before = names.map((name) => Object.getOwnPropertyDescriptor(globalThis, name));
  const set = (name, value) => Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });
  for (const name of names.slice(0, 3)) set(name, function () {});
  set("navigator", { userAgent, hardwareConcurrency: 4 });
  return () => names.forEach((name, i) => (before[i] ? Object.defineProperty(globalThis, name, before[i]) : delete globalThis[name]));
}

test("where threads cannot start, the networks are opened again on one", async () => {
  const restore = asBrowser("");
  const [asked, said] = [[], []];
  const { warn } = console;
  console.warn = (line) => said.push(line);
  const answering = (answer) => () => {
    const worker = {
      terminate: () => asked.push("ended"),
      postMessage: ({ id, threads }) => {
        asked.push(threads);
        queueMicrotask(() => worker.onmessage({ data: { id, ...answer(threads) } }));
      },
    };
    return worker;
  };
  const options = (answer) => ({ weights: OWN, runtime: "/ort/", worker: answering(answer), threads: 4 });
  const sent = (error, threads) => ({ error: sentError(openingFault(error, threads)) });
  try {
    const probe = await AnyProbe.load(options((threads) => (threads > 1 ? sent(new RangeError("Out of memory"), threads) : { result: { threads } })));
    assert.deepEqual([probe.threads, asked], [1, [4, "ended", 1]]);
    assert.deepEqual(said, ["anyprobe: 4 threads could not start (Out of memory); one is used."]);
    const missing = Object.assign(new Error("light.onnx could not be fetched"), { code: "fetch-failed" });
    asked.length = 0;
    await assert.rejects(AnyProbe.load(options((threads) => sent(missing, threads))), { code: "fetch-failed" });
    assert.deepEqual(asked, [4, "ended"], "what is not there is not asked for twice");
  } finally {
    restore();
    console.warn = warn;
  }
});

test("what is not there is named by its address where it was given, and Vite only where it may be it", async () => {
  const restore = asBrowser("");
  const { Worker } = globalThis;
  const started = [];
  globalThis.Worker = function (address) {
    started.push([address, this]);
    this.postMessage = this.terminate = () => {};
  };
  try {
    globalThis.location = { href: "http://localhost/" };
    const loading = AnyProbe.load({ weights: OWN, runtime: "/ort/", worker: "/no-worker.js" });
    await Promise.resolve();
    started[0][1].onerror({});
    await assert.rejects(loading, { message: "The networks' thread could not be started: its script could not be fetched from http://localhost/no-worker.js." });
  } finally {
    globalThis.Worker = Worker;
    restore();
  }
  const missing = new Error("Failed to fetch dynamically imported module: http://localhost/nort/ort.wasm.min.mjs");
  assert.match(openingFault(missing, 1).message, /Vite/);
  assert.doesNotMatch(openingFault(missing, 1, false).message, /Vite/);
});
