/** What the page says where its server does not answer, and of a file without a byte. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { exportTarget } from "../page/downloads.js";
import { fetchExample } from "../page/example.js";
import { openPhoto } from "../page/openPhoto.js";
import { ProbeOpener } from "../page/probe.js";
import { errorLine } from "../page/words.js";

globalThis.document = { baseURI: "http://localhost/" };
globalThis.createImageBitmap = async () => {
  throw new Error("no picture");
};
const radiance = new Float32Array(3 * 64 * 128);
const dominant = { direction: [0, 1, 0], irradiance: [1, 1, 1], color: [1, 1, 1], radiusDeg: 10, power: [1, 1, 1], exists: 0.9, errorDeg: 21.04 };
const ground = { pitchDeg: 20.004, pitchErrorDeg: 4, rollDeg: 3, contact: [200, 300], source: "estimated" };
const light = { radiance, dominant, sources: [dominant], directionality: 0.5, ground, sh9: new Float32Array(27), hints: { surroundings: 0.2 }, wellExposedFraction: 1 };
const about = { photo: "vase", model: "lift", longFovDeg: 50 };

test("a server that does not answer is told of, with what to do", async () => {
  globalThis.fetch = async () => {
    throw new TypeError("Failed to fetch");
  };
  const lost = /^(notes\.txt: )?the server that .+ does not answer; start (anyprobe serve|it) again/;
  await assert.rejects(openPhoto(new Blob(["text"]), "notes.txt", true), {
    message: "notes.txt: the server that opens this kind of file does not answer; start anyprobe serve again, or choose a JPEG or PNG",
  });
  await assert.rejects(exportTarget({ light }, "blender", about), { message: lost });
  await assert.rejects(fetchExample("photos/table.jpg"), { message: lost });
});

test("what a server refuses is said in the page's words, and by its number where it says nothing", async () => {
  const problem = { detail: "photo: no image", text: "expected an image", remedy: [{ do: "run", name: "choose-photo" }] };
  globalThis.fetch = async () => new Response(JSON.stringify(problem), { status: 422 });
  await assert.rejects(openPhoto(new Blob(["text"]), "notes.txt", true), { message: /^notes\.txt: expected an image; choose a photo/ });
  globalThis.fetch = async () => new Response("<html>", { status: 502 });
  await assert.rejects(fetchExample("photos/table.jpg"), { message: "the server answers 502" });
});

test("a file without a byte is told of", async () => {
  await assert.rejects(openPhoto(new Blob([]), "empty.png", true), { message: "empty.png is empty; copy it again" });
});

test("a number of threads in the address that there is not is refused", async () => {
  Object.assign(globalThis, { Worker: class {}, OffscreenCanvas: class {} });
  Object.defineProperty(globalThis, "navigator", { value: {} });
  const opener = new ProbeOpener({ weights: { light: "light.onnx" } }, () => {}, 0);
  globalThis.location = { search: "?threads=abc" };
  await assert.rejects(opener.open(), (error) => errorLine(error) === '?threads: expected a whole number from 1 on, got "abc"');
});

test("an export is sent with what is known of its light", async () => {
  let body;
  globalThis.fetch = async (_, asked) => ((body = asked.body), new Response(new Blob(["zip"])));
  await exportTarget({ light }, "blender", about);
  assert.deepEqual([...body.keys()], ["photo", "sidecar"]);
  const said = JSON.parse(await body.get("sidecar").text());
  assert.equal(said.dominant_light.error_deg, 21.04);
  assert.deepEqual(said.ground, { pitch_deg: 20.004, pitch_error_deg: 4, roll_deg: 3, contact: [200, 300], source: "estimated" });
  await exportTarget({ light: { ...light, ground: null } }, "blender", about);
  assert.equal(JSON.parse(await body.get("sidecar").text()).ground, null);
});
