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

test("a video that cannot be played is told of, and no longer followed", async () => {
  for (const isEarly of [true, false]) {
    const [video, faults] = [Object.assign(new EventTarget(), { videoWidth: 0, requestVideoFrameCallback: () => {} }), []];
    const error = { message: "DEMUXER_ERROR_COULD_NOT_OPEN: no stream" };
    if (isEarly) Object.assign(video, { error });
    const tracker = open().track(video, () => {}, { onError: (fault) => faults.push(fault.message) });
    await settle();
    video.error = error;
    video.dispatchEvent(new Event("error"));
    await settle();
    assert.deepEqual(faults, ["The video cannot be played: DEMUXER_ERROR_COULD_NOT_OPEN: no stream."]);
    assert.ok(!tracker.running);
  }
});

test("a mark that finds nothing is told of beside the light of the object before it", async () => {
  const client = { spares: [], check: () => {}, give: () => {}, ask: async () => {} };
  const seen = [];
  globalThis.createImageBitmap = async () => ({});
  const probe = new AnyProbe(client, { hasMask: true, engine: "wasm", threads: 1 });
  const tracker = probe.track(null, () => seen.push("light"), { onMissed: () => seen.push("missed") });
  await tracker.offer({ videoWidth: 64, videoHeight: 48, readyState: 2 });
  const light = { radiance: new Float32Array(64 * 128 * 3).fill(0.5), dominant: {}, warnings: [] };
  client.onLive({ light, missed: true });
  client.onLive({ light });
  assert.deepEqual(seen, ["missed", "light", "light"]);
  tracker.stop();
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
  const [side, own] = [30, new Float32Array(900)];
  for (let y = 2; y < 28; y++) own.fill(1, y * side + 2, y * side + 28);
  const larger = { width: side, height: side, rgba: new Uint8ClampedArray(4 * 900).fill(255) };
  const [small, light2] = (await probe.estimate(larger, { mask: own })).notices;
  assert.deepEqual([small.code, light2.text], ["object-small", "of the light"]);
});

test("what ends the tracking is reported as the browser's errors are, where nobody else hears it", async () => {
  const reported = [];
  globalThis.reportError = function (error) {
    assert.ok(this === undefined || this === globalThis, "no method of another object");
    reported.push(error.message);
  };
  const tracker = open().track(null, () => {});
  await settle();
  for (const nothing of [undefined, null, "video", { width: 2, height: 2, rgba: new Uint8ClampedArray(16) }]) await tracker.offer(nothing);
  assert.equal(reported.length, 1);
  assert.match(reported[0], /^frame: expected a video, .*, got undefined$/);
  assert.ok(!tracker.running);
});

test("a pose that cannot be asked for later on ends the tracking, and is told of", async () => {
  const [video, faults, shown] = [{ videoWidth: 4, videoHeight: 3 }, [], []];
  video.requestVideoFrameCallback = (next) => shown.push(next);
  globalThis.createImageBitmap = async () => ({});
  let asked = 0;
  const pose = () => {
    if (asked++) throw new Error("no session");
    return [1, 0, 0, 0, 1, 0, 0, 0, 1];
  };
  const tracker = open().track(video, () => {}, { pose, onError: (error) => faults.push(error.message) });
  await settle();
  assert.deepEqual(faults, []);
  shown.at(-1)();
  await settle();
  assert.deepEqual(faults, ["no session"]);
  assert.ok(!tracker.running);
});

test("another kind of light leaves what it does not name", async () => {
  const asked = [];
  const client = { spares: [], check: () => {}, give: () => {}, ask: async (task, given) => asked.push([task, given.options]) };
  globalThis.createImageBitmap = async () => ({});
  const first = { surroundings: "none", emitters: "expected", looks: 2, pitchDeg: 20 };
  const tracker = new AnyProbe(client, {}).track(null, () => {}, first);
  await settle();
  await tracker.set({ pitchDeg: 30, material: "chrome" });
  await tracker.offer({ width: 4, height: 4 });
  const [[, { material, ...rest }]] = asked;
  assert.deepEqual(rest, { ...first, pitchDeg: 30 });
  assert.ok(material instanceof Float32Array);
  await tracker.set({ material: "gold" });
  assert.deepEqual([Object.keys(asked[1][1]), asked[1][1].material instanceof Float32Array], [["material"], true]);
  await assert.rejects(() => tracker.set({ material: "unobtainium" }), refused(/^material: expected one of /));
  await tracker.set();
  await tracker.mark();
});

test("a mask and marks exclude each other, and what finds nothing says where it looked", async () => {
  const probe = open({ mask: { mask: new Float32Array(4), quality: 0, warnings: [] } });
  const picture = { width: 2, height: 2, rgba: new Uint8ClampedArray(16).fill(255) };
  const fails = (options, expected) => assert.rejects(() => probe.estimate(picture, options), expected);
  await fails({ mask: new Float32Array(4), click: [1, 1], box: [0, 0, 2, 2] }, refused("mask and click and box: expected one of them, got both; leave one out"));
  await fails({ mask: 0 }, { code: "invalid-image", message: /^mask: expected a Float32Array .*, got number$/ });
  await fails({ click: [1, 1] }, { code: "no-object", message: /^expected an object at the click in 2 x 2 pixels, found none/ });
  await fails({ mask: null }, { code: "no-object", message: /but nothing stands out; give click, box or mask$/ });
});

test("a picture's transparency is no answer to a click", async () => {
  const found = { mask: new Float32Array(4).fill(1), quality: 0.9, warnings: [] };
  const probe = open({ mask: found, estimate: { light: { warnings: [] } } });
  const picture = { width: 2, height: 2, rgba: new Uint8ClampedArray(16) };
  picture.rgba[3] = 255;
  assert.deepEqual([...(await probe.estimate(picture)).mask.data], [1, 0, 0, 0]);
  assert.deepEqual([...(await probe.estimate(picture, { click: [1, 1] })).mask.data], [1, 1, 1, 1]);
  const [width, height, data] = [24, 24, new Float32Array(576).fill(1)];
  const larger = { width, height, rgba: new Uint8ClampedArray(4 * 576) };
  for (const mask of [{ mask: data }, { data, width, height }]) assert.deepEqual((await probe.estimate(larger, { mask })).mask.data, data);
});

test("normals that are none, a picture's or another frame's are refused", async () => {
  const probe = open({ estimate: { light: { warnings: [] } } });
  const picture = { width: 2, height: 2, rgba: new Uint8ClampedArray(16) };
  picture.rgba[3] = 255;
  const all = (...n) => ({ normals: Float32Array.from({ length: 12 }, (_, i) => n[i % 3]) });
  const fails = (given, message) => assert.rejects(() => probe.estimate(picture, given), refused(message));
  await fails(all(0, 0, 0), /^normals: expected unit vectors where the object is, got none$/);
  await fails(all(NaN, NaN, NaN), /got none$/);
  await fails(all(0.5, 0.5, 1), /got values of a picture, \(n \+ 1\) \/ 2; give 2/);
  await fails(all(0, 0, -1), /^normals: expected normals towards the camera .*, got most that look away/);
  await probe.estimate(picture, all(0, -0.6, 0.8));
});

test("a video that has told its size alone is waited for", async () => {
  const told = [];
  globalThis.createImageBitmap = async () => ({});
  const client = { spares: [], check: () => {}, give: (taken) => told.push(taken), ask: async (task) => void told.push(task) };
  const tracker = new AnyProbe(client, { hasMask: true, engine: "wasm", threads: 1 }).track(null, () => {});
  const video = { videoWidth: 64, videoHeight: 48, readyState: 1 };
  await tracker.offer(video);
  assert.deepEqual([tracker.running, told], [true, []]);
  await tracker.offer(Object.assign(video, { readyState: 2 }));
  assert.equal(told[0], "startLive");
  assert.equal(told.length, 2);
});

test("a light of the source before is not the new one's, and pictures that nobody waits for are closed", async () => {
  let [opened, closed] = [null, 0];
  globalThis.createImageBitmap = async () => ({ close: () => closed++ });
  const client = { spares: [], check: () => {}, give: () => {}, ask: (task) => new Promise((resolve) => task === "startLive" && (opened = resolve)) };
  const heard = [];
  const tracker = new AnyProbe(client, { hasMask: true, engine: "wasm", threads: 1 }).track(null, () => {}, { onLost: () => heard.push("lost") });
  const offered = tracker.offer({ width: 64, height: 48 });
  client.onLive({ lost: true });
  assert.deepEqual(heard, []);
  await settle();
  opened();
  await offered;
  client.onLive({ lost: true });
  assert.deepEqual(heard, ["lost"]);
  const late = tracker.offer({ width: 64, height: 48 });
  tracker.stop();
  await late;
  assert.equal(closed, 1);
});

test("an empty list of marks is none, and a given mask is looked at", async () => {
  const asked = [];
  const client = { spares: [], check: () => {}, ask: async (task, given) => (asked.push([task, given]), { light: { radiance: new Float32Array(3), warnings: [] } }) };
  const probe = new AnyProbe(client, { hasMask: true, engine: "wasm", threads: 1 });
  const rgba = new Uint8ClampedArray(4 * 64 * 64).map((_, i) => (i % 4 === 3 && Math.floor(i / 4) % 64 < 32 ? 0 : 200));
  await probe.estimate({ width: 64, height: 64, rgba }, { click: [], exclude: [] }).catch(() => {});
  assert.deepEqual(asked.map(([task]) => task), ["estimate"]);
  const mask = Float32Array.from({ length: 64 * 64 }, (_, i) => (i % 64 > 4 && i % 64 < 60 ? 0.6 : 0));
  const light = await probe.estimate({ width: 64, height: 64, rgba }, { mask }).catch((error) => error);
  assert.ok(Math.max(...asked[1][1].mask) === 1, String(light));
  assert.match(light.warnings[0], /nowhere white \(at most 0.60\)/);
});

test("a canvas with pixels of another origin is told of as a picture is", async () => {
  globalThis.createImageBitmap = async () => ({});
  const give = () => {
    throw Object.assign(new Error("Non-origin-clean ImageBitmap"), { name: "DataCloneError", code: 25 });
  };
  const client = { spares: [], check: () => {}, give, ask: async () => {} };
  const faults = [];
  const tracker = new AnyProbe(client, { hasMask: true, engine: "wasm", threads: 1 }).track(null, () => {}, { onError: (error) => faults.push(error) });
  await tracker.offer({ width: 64, height: 48 });
  assert.deepEqual(faults.map(({ name, code }) => [name, code]), [["AnyProbeError", "invalid-image"]]);
  assert.match(faults[0].message, /^frame: .* another origin; set crossOrigin$/);
});

test("a picture whose transparency leaves nearly all of it is doubted", async () => {
  const probe = open({ estimate: { light: { warnings: [] } } });
  const rgba = new Uint8ClampedArray(4 * 64 * 64).fill(200).map((value, i) => (i % 4 === 3 ? 255 : value));
  rgba[3] = 0;
  const { warnings } = await probe.estimate({ width: 64, height: 64, rgba });
  assert.match(warnings[0], /its transparency marks 100% of the photo as the object; .*give click, box or mask/);
});

test("masks of the app's own go with the frames: one, one for each, and what MediaPipe gives", async () => {
  globalThis.createImageBitmap = async () => ({});
  const half = { width: 32, height: 24, data: Float32Array.from({ length: 32 * 24 }, (_, i) => (i % 32 < 16 ? 1 : 0)) };
  const ofMediaPipe = { width: 64, height: 48, getAsFloat32Array: () => new Float32Array(64 * 48).fill(1) };
  const frame = { width: 64, height: 48 };
  const given = async (options, about = {}) => {
    const masks = [];
    const client = { spares: [], check: () => {}, give: (_, time, pose, mask) => masks.push(mask), ask: async () => {} };
    const faults = [];
    const probe = new AnyProbe(client, { hasMask: false, engine: "wasm", threads: 1 });
    const tracker = probe.track(null, () => {}, { ...options, onError: ({ code, message }) => faults.push(`${code} ${message}`) });
    for (let i = 0; i < 2; i++) await tracker.offer(frame, about);
    return { masks, faults };
  };
  const share = (mask) => mask && [mask.width, mask.height, mask.data.reduce((sum, value) => sum + value, 0) / mask.data.length];
  assert.deepEqual((await given({ mask: half })).masks.map(share), [[64, 48, 0.5], null], "the first frame's");
  assert.deepEqual((await given({ mask: async () => ofMediaPipe })).masks.map(share), [[64, 48, 1], [64, 48, 1]]);
  assert.deepEqual((await given({ mask: () => null })).masks.map(share), [[64, 48, 0], [64, 48, 0]], "not in the frame");
  assert.deepEqual((await given({}, { mask: half })).masks.map(share), [[64, 48, 0.5], [64, 48, 0.5]]);
  assert.match((await given({ mask: new Float32Array(5) })).faults[0], /^invalid-option mask: expected 64 x 48 numbers, got 5/);
  const square = { width: 24, height: 24, data: new Float32Array(24 * 24) };
  assert.match((await given({ mask: square })).faults[0], /^invalid-option mask: expected the picture's aspect/);
  assert.throws(() => open().track(null, () => {}, { mask: half, click: [1, 1] }), refused(/^mask and click: expected one of them/));
});
