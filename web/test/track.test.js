/** What can be followed, what ends it, and the warnings that come with a light. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { AnyProbe } from "../src/anyprobe.js";
import { checkSource } from "../src/live/frameSource.js";
import { ProbeLight } from "../src/three/index.js";

const refused = (message) => ({ name: "AnyProbeError", code: "invalid-option", message });
const settle = () => new Promise((resolve) => setTimeout(resolve, 5));

class Track extends EventTarget {
  readyState = "live";
  constructor(kind = "video") {
    super();
    this.kind = kind;
  }
  getSettings() {
    return { width: 64, height: 48 };
  }
}
globalThis.MediaStreamTrack = Track;
const streamOf = (...tracks) => ({ getVideoTracks: () => tracks });

/** A probe whose thread answers everything at once. */
function open(answers = {}) {
  const client = { spares: [], check: () => {}, give: () => {}, ask: async (task) => answers[task] };
  return new AnyProbe(client, { hasMask: true, engine: "wasm", threads: 1 });
}

test("what holds no frames is refused at once, by a probe and by its light", () => {
  for (const source of ["video", {}, undefined, 3, streamOf(), new Track("audio")]) {
    assert.throws(() => open().track(source, () => {}), refused(/^source: expected a video element, a canvas, .* got /));
    assert.throws(() => new ProbeLight(open()).track(source), refused(/^source: /));
  }
  assert.throws(() => checkSource(Object.assign(new Track(), { readyState: "ended" })), refused(/a track of video, ended$/));
});

test("a video, a canvas, a track, a stream's first track and offered frames are followed", () => {
  const [video, canvas, track] = [{ videoWidth: 0 }, { getContext: () => {} }, new Track()];
  for (const source of [video, canvas, track, null]) assert.equal(checkSource(source), source);
  assert.equal(checkSource(streamOf(track, new Track())), track);
});

test("a camera that ends is told of once, and no longer followed", async () => {
  for (const hasProcessor of [true, false]) {
    const reads = [];
    const reader = { read: () => new Promise((resolve) => reads.push(resolve)), cancel: async () => {} };
    if (hasProcessor) globalThis.MediaStreamTrackProcessor = class { readable = { getReader: () => reader }; };
    else delete globalThis.MediaStreamTrackProcessor;
    globalThis.document = { createElement: () => ({ play: async () => {}, requestVideoFrameCallback: () => {}, videoWidth: 0 }) };
    globalThis.MediaStream = class {};
    globalThis.createImageBitmap = async () => ({});
    const [track, faults] = [new Track(), []];
    const tracker = open().track(track, () => {}, { onError: (error) => faults.push(error) });
    await settle();
    assert.ok(tracker.running);
    track.dispatchEvent(new Event("ended"));
    for (const read of reads) read({ done: true });
    await settle();
    assert.deepEqual(faults.map(({ code }) => code), ["failed"]);
    assert.match(faults[0].message, /track has ended; open the camera, and track again/);
    assert.ok(!tracker.running);
  }
});

test("what is to be called or to give up is refused where it cannot be", () => {
  for (const wrong of [undefined, null, {}]) assert.throws(() => open().track(null, wrong), refused(/^onLight: expected a function/));
  for (const name of ["onError", "onLost", "pose"]) {
    assert.throws(() => open().track(null, () => {}, { [name]: 3 }), refused(`${name}: expected a function, got 3`));
  }
  assert.throws(() => open().track(null, () => {}, { signal: {} }), refused(/^signal: expected an AbortSignal/));
});

test("a pose that is none is told of", async () => {
  for (const pose of [5, {}, { matrixWorld: {} }]) {
    const faults = [];
    const tracker = open().track(null, () => {}, { onError: (error) => faults.push(error) });
    await settle();
    await tracker.offer({ width: 4, height: 4 }, { pose });
    assert.deepEqual(faults.map(({ code }) => code), ["invalid-option"]);
    assert.match(faults[0].message, /^pose: expected 16 numbers/);
  }
});

test("what is doubtful about a mask that was found comes first among a light's warnings", async () => {
  const [width, height] = [2, 2];
  const mask = { mask: new Float32Array(4), quality: 0.5, warnings: ["of the mask"] };
  const probe = open({ mask, estimate: { light: { warnings: ["of the light"] } } });
  const picture = { width, height, rgba: new Uint8ClampedArray(16).fill(255) };
  const light = await probe.estimate(picture);
  assert.deepEqual(light.warnings, ["of the mask", "of the light"]);
  assert.deepEqual((await probe.estimate(picture, { mask: new Float32Array(4) })).warnings, ["of the light"]);
});
