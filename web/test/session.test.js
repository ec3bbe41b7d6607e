/** The camera is opened once, closed by whatever ends it, and followed however it is held. */

import assert from "node:assert/strict";
import { afterEach, test } from "node:test";

import { AnyProbe } from "../src/anyprobe.js";
import { LiveSession } from "../page/live/session.js";

const LIVE = "Live, in this browser. If the outline is wrong, click on the object, or draw a box around it.";
const LOST = /^No object is seen/;
const MISSED = /^Nothing is found there. The last object is followed on/;
const said = []; // every line of status
const elements = new Map();
const sessions = [];
let cameras = []; // asked for and not yet given
let streams = [];

globalThis.document = {
  dispatchEvent: () => {},
  createElement: () => ({}),
  getElementById: (id) => {
    if (!elements.has(id)) elements.set(id, makeElement(id));
    return elements.get(id);
  },
};
globalThis.createImageBitmap = async () => ({});
Object.defineProperty(globalThis, "navigator", {
  value: { mediaDevices: { getUserMedia: () => new Promise((resolve, reject) => cameras.push({ resolve, reject })) } },
});

function makeElement(id) {
  const attributes = {};
  return {
    setAttribute: (name, value) => (attributes[name] = value),
    getAttribute: (name) => attributes[name],
    classList: { toggle: () => {} },
    replaceChildren: (...parts) => {
      if (id === "status") said.push(parts.map((part) => part.textContent ?? part).join(""));
    },
  };
}

function makeStream() {
  const track = Object.assign(new EventTarget(), { isLive: true, stop: () => (track.isLive = false) });
  streams.push(track);
  return { getTracks: () => [track], getVideoTracks: () => [track] };
}

/** Let everything run that waits for nothing else. */
const settle = () => new Promise((resolve) => setTimeout(resolve, 5));

/** A session beside networks that are open at once and a page that notes what is asked of it. */
function begin({ opening = Promise.resolve(), play = async () => {} } = {}) {
  const video = {
    size: [64, 48],
    srcObject: null,
    play,
    requestVideoFrameCallback: () => {},
    get videoWidth() {
      return this.size[0];
    },
    get videoHeight() {
      return this.size[1];
    },
  };
  const asked = [];
  const page = { shown: 0, faults: [], placed: [], opened: [], drawn: [], panels: 0, asked };
  const networks = {
    spares: [],
    open: () => opening.then(() => new AnyProbe(networks, { hasMask: true, threads: 1 })),
    check: () => {},
    ask: async (task, given) => void asked.push({ task, ...given }),
    give: () => {},
  };
  const session = new LiveSession({
    networks,
    config: { model: "lift" },
    stage: {
      video,
      showVideo: () => page.shown++,
      place: (...at) => page.placed.push(at.slice(0, 2)),
      setLight: () => {},
      stage: { setMask: () => {} },
    },
    light: { show: () => page.panels++ },
    marking: {
      open: ({ width, height }) => page.opened.push([width, height]),
      show: () => {},
      glide: (...by) => (page.glided = by),
      follow: ({ width, height }, hints) => page.drawn.push({ size: [width, height], hints }),
    },
    options: () => ({ surroundings: false }),
    onShown: () => {},
    onMask: () => {},
    onFault: (error) => page.faults.push(error.message),
  });
  sessions.push(session);
  return { session, video, networks, page };
}

/** The same, once it is live. */
async function follow() {
  const parts = begin();
  parts.session.start();
  cameras[0].resolve(makeStream());
  await settle();
  return parts;
}

afterEach(() => {
  for (const session of sessions) session.stop();
  [said.length, sessions.length] = [0, 0];
  [cameras, streams] = [[], []];
});

const answer = (width, height, mask = null) => ({ width, height, mask, box: [0, 0, 9, 9], light: {} });
const maskOf = (width, height) => new Float32Array(width * height);

test("map and spheres are drawn of a light now and then", async () => {
  const { networks, page } = await follow();
  for (let i = 0; i < 16; i++) networks.onLive({ ...answer(64, 48, maskOf(64, 48)), time: 100 + i / 15 });
  assert.equal(page.panels, 2);
});

test("a camera that is being opened is not opened again", async () => {
  const { session } = begin();
  session.start();
  session.start();
  for (const { resolve } of cameras) resolve(makeStream());
  await settle();
  assert.ok(session.running);
  assert.equal(streams.length, 1);
  session.stop();
  assert.ok(!streams[0].isLive && !session.running);
});

test("a camera that comes after it was stopped is closed, and begun anew by the next press", async () => {
  const { session, video, page } = begin();
  session.start();
  session.stop();
  cameras[0].resolve(makeStream());
  await settle();
  assert.ok(!streams[0].isLive && !session.running && video.srcObject === null && page.shown === 0);
  session.start();
  cameras[1].resolve(makeStream());
  await settle();
  assert.ok(streams[1].isLive && session.running);
});

test("a video that does not play, or networks that do not open, close the camera and are told", async () => {
  const refused = Promise.reject(new Error("no networks"));
  refused.catch(() => {});
  const play = async () => Promise.reject(new Error("no video"));
  for (const [given, fault] of [[{ play }, "no video"], [{ opening: refused }, "no networks"]]) {
    [cameras, streams] = [[], []];
    const { session, video, page } = begin(given);
    session.start();
    cameras[0].resolve(makeStream());
    await settle();
    assert.deepEqual(page.faults, [fault]);
    assert.ok(!streams[0].isLive && !session.running && video.srcObject === null);
  }
});

test("what fails after it was stopped is of no interest", async () => {
  const { session, page } = begin();
  session.start();
  session.stop();
  cameras[0].reject(Object.assign(new Error("no"), { name: "NotAllowedError" }));
  await settle();
  assert.deepEqual(page.faults, []);
});

test("a camera that ends by itself is closed and told, once", async () => {
  const { session, page } = await follow();
  for (let i = 0; i < 2; i++) streams[0].dispatchEvent(new Event("ended"));
  assert.ok(!session.running);
  assert.equal(page.faults.length, 1);
  assert.match(page.faults[0], /^The camera has ended/);
});

test("an object that is lost is told once, and found again", async () => {
  const { networks } = await follow();
  const lines = (answers) => {
    said.length = 0;
    for (const one of answers) networks.onLive(one);
    return [...said];
  };
  const lost = { lost: true, width: 64, height: 48 };
  assert.deepEqual(lines([answer(64, 48, maskOf(64, 48)), answer(64, 48)]), [LIVE]);
  const [line, ...others] = lines([lost, lost, lost]);
  assert.match(line, LOST);
  assert.deepEqual(others, []);
  assert.deepEqual(lines([answer(64, 48), answer(64, 48)]), [LIVE]);
});

test("a click while nothing is seen is answered", async () => {
  const { session, networks } = await follow();
  const lost = { lost: true, width: 64, height: 48 };
  networks.onLive(lost);
  said.length = 0;
  session.mark({ click: [[32, 24]], exclude: [], box: null });
  assert.deepEqual(said, ["Finding the object …"], "at once, as no answer comes while it is looked for");
  said.length = 0;
  networks.onLive(lost);
  assert.match(said[0], LOST);
});

test("a click that finds nothing is told, and the last object is followed on with its own clicks", async () => {
  const { session, networks, page } = await follow();
  const first = { click: [[32, 24]], exclude: [], box: null };
  await session.mark(first);
  networks.onLive(answer(64, 48, maskOf(64, 48)));
  await session.mark({ click: [[1, 1]], exclude: [], box: null });
  said.length = 0;
  networks.onLive({ ...answer(64, 48, maskOf(64, 48)), missed: true });
  await settle();
  networks.onLive(answer(64, 48));
  assert.equal(said.length, 1);
  assert.match(said[0], MISSED);
  assert.deepEqual(page.drawn.at(-1), { size: [64, 48], hints: first });
  await session.mark(first);
  networks.onLive(answer(64, 48, maskOf(64, 48)));
  assert.equal(said.at(-1), LIVE);
});

test("after a click the object is placed by the new mask alone, not by one that was under way", async () => {
  const { session, networks, page } = await follow();
  networks.onLive(answer(64, 48, maskOf(64, 48)));
  assert.equal(page.placed.length, 1);
  let reply;
  networks.ask = () => new Promise((resolve) => (reply = resolve));
  session.mark({ click: [[32, 24]], exclude: [], box: null });
  networks.onLive(answer(64, 48, maskOf(64, 48))); // of what was marked before
  reply();
  await settle();
  networks.onLive({ ...answer(64, 48, maskOf(64, 48)), searching: true });
  assert.equal(page.placed.length, 1);
  for (let turn = 0; turn < 2; turn++) networks.onLive(answer(64, 48, maskOf(64, 48)));
  assert.equal(page.placed.length, 2);
});

test("a reply to a click of a camera that was closed does not touch the next one's object", async () => {
  const { session, networks } = await follow();
  let reply;
  const { ask } = networks;
  networks.ask = () => new Promise((resolve) => (reply = resolve));
  session.mark({ click: [[32, 24]], exclude: [], box: null });
  session.stop();
  networks.ask = ask;
  session.start();
  cameras[1].resolve(makeStream());
  await settle();
  networks.onLive(answer(64, 48, maskOf(64, 48)));
  reply();
  await settle();
  assert.ok(session.placed);
});

test("a camera that is turned is fitted, and its object placed, anew", async () => {
  const { session, video, networks, page } = await follow();
  networks.onLive(answer(64, 48, maskOf(64, 48)));
  video.size = [48, 64];
  networks.onLive(answer(48, 64));
  assert.equal(page.shown, 2);
  assert.deepEqual(page.placed, [[64, 48]]); // no mask of this size yet
  await settle();
  assert.deepEqual(page.opened, [[64, 48], [48, 64]]);
  networks.onLive(answer(48, 64, maskOf(48, 64)));
  assert.deepEqual(page.placed, [[64, 48], [48, 64]]);
  session.mark({ click: [[24, 16]], exclude: [], box: null });
  assert.deepEqual(page.asked.at(-1).hints.on, [[0.5, 0.25]]);
});

test("what is clicked on before the networks are open is told with the start", async () => {
  let open;
  const { session, page } = begin({ opening: new Promise((resolve) => (open = resolve)) });
  session.start();
  cameras[0].resolve(makeStream());
  await settle();
  session.mark({ click: [[32, 24]], exclude: [], box: null });
  session.setOptions();
  assert.deepEqual(page.asked, []);
  open();
  await settle();
  assert.deepEqual(page.asked.map(({ task }) => task), ["open"]);
  assert.deepEqual(page.asked[0].hints, { on: [[0.5, 0.5]], off: [], box: null });
});

test("what is stopped while the networks' thread begins does not go on", async () => {
  const { session, networks } = begin();
  let told;
  networks.ask = () => new Promise((resolve) => (told = resolve));
  session.start();
  cameras[0].resolve(makeStream());
  await settle();
  const { tracker } = session.live;
  session.stop();
  told();
  await settle();
  assert.ok(!tracker.running && networks.onLive === undefined);
});

test("the outline goes on with the object between the answers, and rests with it", async () => {
  const { session, video, networks, page } = begin();
  const calls = [];
  video.requestVideoFrameCallback = (call) => calls.push(call);
  const onPicture = () => calls.splice(0).forEach((call) => call(0, {}));
  session.start();
  cameras[0].resolve(makeStream());
  await settle();
  const at = (left, time) => networks.onLive({ ...answer(64, 48, maskOf(64, 48)), box: [left, 10, left + 20, 30], time });
  const now = performance.now() / 1000;
  at(10, now - 0.4);
  at(16, now - 0.2); // 30 pixels a second
  onPicture();
  const age = performance.now() / 1000 - now + 0.2;
  assert.ok(Math.abs(64 * page.glided[0] - 30 * age) < 1 && page.glided[1] === 0, `${page.glided}`);
  at(16, now - 0.1);
  onPicture();
  assert.equal(page.glided[0], 0);
});
