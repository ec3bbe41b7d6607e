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
  return new AnyProbe(client, { hasMask: true, threads: 1 });
}

test("what holds no frames is refused at once, by a probe and by its light", () => {
  for (const source of ["video", {}, undefined, 3, streamOf(), new Track("audio")]) {
    assert.throws(() => open().track(source, () => {}), refused(/^source: expected a video element, a canvas, .* got /));
    assert.throws(() => new ProbeLight(open()).track(source), refused(/^source: /));
  }
  assert.throws(() => checkSource(Object.assign(new Track(), { readyState: "ended" })), refused(/a track of video, ended$/));
});

test("a video, a canvas, a track, a stream's first track and offered frames are followed", () => {
  const [video, canvas, track] = [{ videoWidth: 0 }, { getContext: () => {}, width: 2, height: 2 }, new Track()];
  for (const source of [video, canvas, track, null]) assert.equal(checkSource(source), source);
  assert.equal(checkSource(streamOf(track, new Track())), track);
});

test("a canvas without pixels and a video without a source are refused at once", () => {
  for (const [source, got] of [
    [{ getContext: () => {}, width: 0, height: 150 }, /^source: expected a canvas with pixels, got one of 0 x 150$/],
    [{ videoWidth: 0, networkState: 0 }, /^source: expected a video with a source, got one without; set its src/],
  ]) {
    assert.throws(() => open().track(source, () => {}), refused(got));
  }
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
  const probe = new AnyProbe(client, { hasMask: true, threads: 1 });
  const tracker = probe.track(null, () => seen.push("light"), { onMissed: () => seen.push("missed") });
  await tracker.offer({ videoWidth: 64, videoHeight: 48, readyState: 2 });
  const light = { radiance: new Float32Array(64 * 128 * 3).fill(0.5), dominant: {}, warnings: [] };
  client.onLive({ light, missed: true });
  client.onLive({ light });
  assert.deepEqual(seen, ["missed", "light", "light"]);
  tracker.stop();
});

test("a camera that ends is told of once, and no longer followed", async () => {
  globalThis.document = { createElement: () => ({ play: async () => {}, requestVideoFrameCallback: () => {}, videoWidth: 0 }) };
  globalThis.MediaStream = class {};
  globalThis.createImageBitmap = async () => ({});
  const [track, faults] = [new Track(), []];
  const tracker = open().track(track, () => {}, { onError: (error) => faults.push(error) });
  await settle();
  assert.ok(tracker.running);
  for (let i = 0; i < 2; i++) track.dispatchEvent(new Event("ended"));
  await settle();
  assert.deepEqual(faults.map(({ code }) => code), ["failed"]);
  assert.match(faults[0].message, /track has ended; open the camera, and track again/);
  assert.ok(!tracker.running);
});

test("what is to be called or to give up is refused where it cannot be", () => {
  for (const wrong of [undefined, null, {}]) assert.throws(() => open().track(null, wrong), refused(/^onLight: expected a function/));
  for (const name of ["onError", "onLost", "pose"]) {
    assert.throws(() => open().track(null, () => {}, { [name]: 3 }), refused(`${name}: expected a function, got 3`));
  }
  assert.throws(() => open().track(null, () => {}, { signal: {} }), refused(/^signal: expected an AbortSignal/));
});

test("an offer that is wrong rejects, and the next one is taken", async () => {
  const [given, faults] = [[], []];
  globalThis.createImageBitmap = async () => ({});
  const client = { spares: [], check: () => {}, give: (...frame) => given.push(frame), ask: async () => {} };
  const tracker = new AnyProbe(client, {}).track(null, () => {}, { onError: (error) => faults.push(error) });
  const frame = { width: 4, height: 4 };
  for (const pose of [5, {}, { matrixWorld: {} }]) await assert.rejects(tracker.offer(frame, { pose }), refused(/^pose: expected 16 numbers/));
  for (const nothing of [undefined, null, "video", { width: 2, height: 2, rgba: new Uint8ClampedArray(16) }]) {
    await assert.rejects(tracker.offer(nothing), { code: "invalid-image", message: /^frame: expected a video, .*, got / });
  }
  for (const [about, message] of [
    [{ poses: [] }, /^tracker\.offer: unknown option poses; expected of pose, mask, time$/],
    [null, /^tracker\.offer: expected an object of options, got null/],
    [{ time: "now" }, 'time: expected milliseconds of performance.now(), got "now"'],
    [{ time: NaN }, /^time: .* got NaN/],
    [{ mask: new Float32Array(5) }, /^mask: expected 4 x 4 numbers, got 5/],
  ]) {
    await assert.rejects(tracker.offer(frame, about), refused(message));
  }
  await tracker.offer(frame, { pose: [1, 0, 0, 0, 1, 0, 0, 0, 1], time: 2000 });
  assert.deepEqual([given.length, given[0][1], faults, tracker.running], [1, 2, [], true]);
  tracker.fail(new Error("the camera is gone"));
  assert.deepEqual(faults.map(({ name, code }) => [name, code]), [["AnyProbeError", "failed"]]);
  await assert.rejects(tracker.offer(frame), faults[0]);
});

test("what is doubtful about a mask that was found comes first among a light's warnings", async () => {
  const [width, height] = [2, 2];
  const mask = { mask: new Float32Array(4), quality: 0.5, warnings: ["of the mask"] };
  const probe = open({ mark: mask, estimate: { light: { warnings: ["of the light"] } } });
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
  const tracker = open().track(null, () => {}, { fovDeg: 200 });
  await settle();
  for (let i = 0; i < 2; i++) await assert.rejects(tracker.offer({ width: 4, height: 4 }), refused(/^fovDeg: /));
  assert.equal(reported.length, 1);
  assert.match(reported[0], /^fovDeg: expected degrees/);
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
  const first = { surroundings: "none", pitchDeg: 20 };
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
  const probe = open({ mark: { mask: new Float32Array(4), quality: 0, warnings: [] } });
  const picture = { width: 2, height: 2, rgba: new Uint8ClampedArray(16).fill(255) };
  const fails = (options, expected) => assert.rejects(() => probe.estimate(picture, options), expected);
  await fails({ mask: new Float32Array(4), click: [1, 1], box: [0, 0, 2, 2] }, refused("mask and click and box: expected one of them, got both; leave one out"));
  await fails({ mask: 0 }, { code: "invalid-image", message: /^mask: expected a Float32Array .*, got number$/ });
  await fails({ click: [1, 1] }, { code: "no-object", message: "expected an object at the click, found none; give box or mask" });
  await fails({ click: [1, 1], exclude: [0, 0] }, { code: "no-object", message: /^expected an object at the click, found none/ });
  await fails({ exclude: [0, 0] }, { code: "no-object", message: /^expected an object away from exclude, found none/ });
  await fails({ mask: null }, { code: "no-object", message: /but nothing stands out; give click, box or mask$/ });
});

test("a picture's transparency is no answer to a click", async () => {
  const found = { mask: new Float32Array(4).fill(1), quality: 0.9, warnings: [] };
  const probe = open({ mark: found, estimate: { light: { warnings: [] } } });
  const picture = { width: 2, height: 2, rgba: new Uint8ClampedArray(16) };
  picture.rgba[3] = 255;
  assert.deepEqual([...(await probe.estimate(picture)).mask.data], [1, 0, 0, 0]);
  assert.deepEqual([...(await probe.estimate(picture, { click: [1, 1] })).mask.data], [1, 1, 1, 1]);
  const [width, height, data] = [24, 24, new Float32Array(576).fill(1)];
  const larger = { width, height, rgba: new Uint8ClampedArray(4 * 576) };
  for (const mask of [data, { data, width, height }]) assert.deepEqual((await probe.estimate(larger, { mask })).mask.data, data);
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

test("frames that are offered count in the rates, those that come while one is read too", async () => {
  globalThis.createImageBitmap = async () => ({});
  const tracker = open().track(null, () => {}, { mask: () => null });
  await Promise.all(Array.from({ length: 4 }, () => tracker.offer({ width: 64, height: 48 })));
  await tracker.offer({ videoWidth: 64, videoHeight: 48, readyState: 1 });
  assert.equal(tracker.rates().frames, 2, "4 in 2 seconds; a video without a picture yet has no frame");
  tracker.stop();
});

test("a video that has told its size alone is waited for", async () => {
  const told = [];
  globalThis.createImageBitmap = async () => ({});
  const client = { spares: [], check: () => {}, give: (taken) => told.push(taken), ask: async (task) => void told.push(task) };
  const tracker = new AnyProbe(client, { hasMask: true, threads: 1 }).track(null, () => {});
  const video = { videoWidth: 64, videoHeight: 48, readyState: 1 };
  await tracker.offer(video);
  assert.deepEqual([tracker.running, told], [true, []]);
  await tracker.offer(Object.assign(video, { readyState: 2 }));
  assert.equal(told[0], "open");
  assert.equal(told.length, 2);
});

test("a light of the source before is not the new one's, and pictures that nobody waits for are closed", async () => {
  let [opened, closed] = [null, 0];
  globalThis.createImageBitmap = async () => ({ close: () => closed++ });
  const client = { spares: [], check: () => {}, give: () => {}, ask: (task) => new Promise((resolve) => task === "open" && (opened = resolve)) };
  const heard = [];
  const tracker = new AnyProbe(client, { hasMask: true, threads: 1 }).track(null, () => {}, { onLost: () => heard.push("lost") });
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
  const probe = new AnyProbe(client, { hasMask: true, threads: 1 });
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
  const tracker = new AnyProbe(client, { hasMask: true, threads: 1 }).track(null, () => {});
  const foreign = { name: "AnyProbeError", code: "invalid-image", message: /^frame: .* another origin; set crossOrigin$/ };
  await assert.rejects(tracker.offer({ width: 64, height: 48 }), foreign);
});

test("a picture whose transparency leaves nearly all of it is doubted", async () => {
  const probe = open({ estimate: { light: { warnings: [] } } });
  const rgba = new Uint8ClampedArray(4 * 64 * 64).fill(200).map((value, i) => (i % 4 === 3 ? 255 : value));
  rgba[3] = 0;
  const { warnings } = await probe.estimate({ width: 64, height: 64, rgba });
  assert.match(warnings.at(-1), /its transparency marks 100% of the photo as the object; .*give click, box or mask/);
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
    const probe = new AnyProbe(client, { hasMask: false, threads: 1 });
    const tracker = probe.track(null, () => {}, { ...options, onError: ({ code, message }) => faults.push(`${code} ${message}`) });
    for (let i = 0; i < 2; i++) await tracker.offer(frame, about).catch(() => {});
    return { masks, faults };
  };
  const share = (mask) => mask && [mask.width, mask.height, mask.data.reduce((sum, value) => sum + value, 0) / mask.data.length];
  assert.deepEqual((await given({ mask: half })).masks.map(share), [[64, 48, 0.5], null], "the first frame's");
  assert.deepEqual((await given({ mask: async () => ofMediaPipe })).masks.map(share), [[64, 48, 1], [64, 48, 1]]);
  assert.deepEqual((await given({ mask: () => null })).masks.map(share), [[64, 48, 0], [64, 48, 0]], "not in the frame");
  assert.deepEqual((await given({}, { mask: half })).masks.map(share), [[64, 48, 0.5], [64, 48, 0.5]]);
  assert.match((await given({ mask: new Float32Array(5) })).faults[0], /^invalid-option mask: expected 64 x 48 numbers, got 5/);
  const undecided = await given({ mask: () => undefined });
  assert.deepEqual([undecided.masks, undecided.faults.length], [[], 1], "not the network's choice");
  assert.match(undecided.faults[0], /^invalid-option mask: expected a function that gives a mask, or null where the object is not seen, got undefined/);
  const square = { width: 24, height: 24, data: new Float32Array(24 * 24) };
  assert.match((await given({ mask: square })).faults[0], /^invalid-option mask: expected the picture's aspect/);
  assert.throws(() => open().track(null, () => {}, { mask: half, click: [1, 1] }), refused(/^mask and click: expected one of them/));
});

test("a mask that was found is a Mask, and keeps its quality and warnings in an estimate", async () => {
  const side = 30;
  const mask = Float32Array.from({ length: side * side }, (_, i) => (i % side > 1 && i % side < 28 ? 1 : 0));
  const doubt = { code: "mask-doubtful", subject: [], text: "it may be wrong", remedy: ["box", "mask"].map((name) => ({ do: "give", name })) };
  const asked = [];
  const answers = { mark: { mask, quality: 0.7, warnings: [doubt], seconds: 1 }, estimate: { light: { warnings: [] } } };
  const client = { check: () => {}, ask: async (task, given) => (asked.push(given), answers[task]) };
  const probe = new AnyProbe(client, {});
  const picture = { width: side, height: side, rgba: new Uint8ClampedArray(4 * side * side).fill(255) };
  const found = await probe.mask(picture, { click: [9, 9] });
  assert.deepEqual([found.data, found.width, found.height, found.quality, found.seconds], [mask, side, side, 0.7, 1]);
  assert.deepEqual(found.warnings, ["it may be wrong; give box"], "probe.mask takes no mask");
  const light = await probe.estimate(picture, { mask: found });
  assert.deepEqual([light.mask.quality, light.mask.warnings, light.warnings], [0.7, found.warnings, found.warnings]);
  assert.deepEqual((await probe.estimate(picture, { mask: light.mask })).warnings, found.warnings);
  assert.equal((await probe.estimate(picture, { mask: { data: mask, width: side, height: side } })).mask.quality, null);
  await probe.estimate(picture, { click: [9, 9] });
  assert.deepEqual(asked.at(-1).marks, ["click"], "of which the networks' thread speaks where it is too small");
});

test("pixels that are no bytes, an empty address and a canvas without pixels are refused", async () => {
  const fails = (source, message) => assert.rejects(open().estimate(source), { code: "invalid-image", message });
  for (const rgba of [new Float32Array(16), new Uint16Array(16), new Array(16).fill(0)]) {
    await fails({ width: 2, height: 2, rgba }, `image: expected Uint8ClampedArray (or Uint8Array), got ${rgba.constructor.name}`);
  }
  await fails("", /^image: expected an address, .*, got an empty address$/);
  globalThis.OffscreenCanvas = class {};
  await fails(Object.assign(new OffscreenCanvas(), { width: 0, height: 150 }), "image: expected a picture with pixels, got one that is 0 x 150 pixels");
  globalThis.createImageBitmap = async () => Promise.reject(new Error("none"));
  globalThis.fetch = async () => new Response(new Blob(["<html>"], { type: "text/html" }));
  await fails("index.html", "image: expected a file that the browser can show, got text/html of 6 bytes from index.html");
  globalThis.fetch = undefined;
});
