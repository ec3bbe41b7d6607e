/** The camera's frames become lights: always the newest, its mask found anew where the picture has changed. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { FrameLight } from "../src/live/frameLight.js";
import { Newest } from "../src/live/newest.js";

const [WIDTH, HEIGHT] = [160, 120];

/** A bright square on a dark ground, with the camera's noise, as a frame's memory. */
function frameOf(left, noise, random) {
  const count = WIDTH * HEIGHT;
  const bytes = new Uint8Array(1.5 * count).fill(128);
  for (let i = 0; i < count; i++) {
    const [x, y] = [i % WIDTH, Math.floor(i / WIDTH)];
    const isInside = x >= left && x < left + 60 && y >= 30 && y < 90;
    bytes[i] = (isInside ? 180 : 60) + noise * (random() - 0.5);
  }
  const chroma = (offset) => ({ offset, stride: WIDTH / 2 });
  const layout = [{ offset: 0, stride: WIDTH }, chroma(count), chroma(1.25 * count)];
  return { width: WIDTH, height: HEIGHT, format: "I420", layout, matrix: "bt709", fullRange: false, bytes };
}

/** Numbers in [0, 1) that are the same in every run. */
function numbers(seed) {
  return () => (seed = (seed * 16807) % 2147483647) / 2147483647;
}

/** What is bright. */
const foundIn = (rgba) => ({ mask: Float32Array.from({ length: rgba.length / 4 }, (_, i) => (rgba[4 * i] > 120 ? 1 : 0)), quality: 0.9 });

/** How often the mask was found in so many frames, and how often it was told. */
async function follow(count, leftOf, markAt = -1, hints = { on: [[0.5, 0.5]], off: [] }) {
  const random = numbers(5);
  const models = { light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(0.5) }) };
  const seen = { found: [], told: [], hints: [] };
  let at = 0;
  const findMask = async ({ rgba }, told) => {
    seen.found.push(at);
    seen.hints.push(told);
    return foundIn(rgba);
  };
  const lights = new FrameLight(models, findMask, { on: [], off: [] }, 65);
  for (; at < count; at++) {
    if (at === markAt) lights.mark(hints);
    const { mask } = await lights.next(frameOf(leftOf(at), 10, random), at / 15);
    if (mask) seen.told.push(at);
  }
  return seen;
}

test("the mask of a still picture is found twice, of a moving one every fourth frame", async () => {
  const still = await follow(40, () => 50);
  assert.deepEqual(still.found, [0, 32]);
  const moving = await follow(40, (at) => 20 + at);
  assert.deepEqual(moving.found, [0, 4, 8, 12, 16, 20, 24, 28, 32, 36]);
  assert.deepEqual(moving.told, moving.found);
});

test("whether the object is cut out is seen anew with its mask", async () => {
  const random = numbers(5);
  const contexts = [];
  const light = async (image, tanHalf, { context }) => {
    contexts.push(context !== null);
    return { radiance: new Float32Array(64 * 128 * 3).fill(0.5) };
  };
  const lights = new FrameLight({ light, completes: true }, async ({ rgba }) => foundIn(rgba), { on: [], off: [] }, 65);
  for (let at = 0; at < 34; at++) await lights.next(frameOf(50, at === 0 ? 10 : 0, random), at / 15);
  assert.deepEqual([contexts[0], contexts[31], contexts[32]], [true, true, false]);
});

test("a jump is seen at once, and a click", async () => {
  const jumped = await follow(20, (at) => (at < 10 ? 50 : 53));
  assert.deepEqual(jumped.found, [0, 10]);
  const clicked = await follow(20, () => 50, 7);
  assert.deepEqual(clicked.found, [0, 7]);
});

test("a light that was under way when an object was clicked on tells no mask, the next one tells the new", async () => {
  const random = numbers(5);
  let onLook = () => {};
  const models = {
    light: async () => {
      onLook();
      return { radiance: new Float32Array(64 * 128 * 3).fill(0.5) };
    },
  };
  const findMask = async ({ rgba }) => foundIn(rgba);
  const lights = new FrameLight(models, findMask, { on: [], off: [] }, 65);
  const next = async (at) => (await lights.next(frameOf(50, 10, random), at / 15)).mask;
  onLook = () => lights.mark({ on: [[0.5, 0.5]], off: [] });
  assert.equal(await next(0), null);
  onLook = () => {};
  assert.ok(await next(1));
});

test("a box is told in pixels, and from then on the box of what it had inside, and a margin", async () => {
  const { found, hints } = await follow(20, (at) => 20 + at, 5, { on: [], off: [], box: [0.25, 0.25, 0.75, 1] });
  assert.equal(found[2], 5);
  assert.deepEqual(hints[2], { on: [], off: [], box: [0.25 * WIDTH, 0.25 * HEIGHT, 0.75 * WIDTH, HEIGHT] });
  const more = 0.12 * 60;
  assert.deepEqual(hints[3], { on: [], off: [], box: [25 - more, 30 - more, 85 + more, 90 + more] });
});

test("where a click finds nothing the object before it is followed on", async () => {
  const random = numbers(5);
  const models = { light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(0.5) }) };
  const told = [];
  const findMask = async ({ rgba }, hints) => {
    told.push(hints);
    const found = foundIn(rgba);
    const [[x] = [80]] = hints.on;
    if (x > 20 && x < 50) return { ...found, quality: 0.01 };
    return x < 50 ? { mask: new Float32Array(found.mask.length), quality: 0 } : found;
  };
  const lights = new FrameLight(models, findMask, { on: [[0.5, 0.5]], off: [], box: null }, 65);
  const next = (at) => lights.next(frameOf(50, 10, random), at / 15);
  assert.ok((await next(0)).mask);
  lights.mark({ on: [[0.1, 0.5]], off: [], box: null });
  const missed = await next(1);
  assert.deepEqual([missed.missed, missed.lost, told.length], [true, undefined, 3]);
  assert.ok(missed.mask);
  assert.ok(told[2].box); // around the object, as it is followed
  assert.equal((await next(2)).missed, undefined);
  lights.mark({ on: [[0.2, 0.5]], off: [], box: null });
  assert.equal((await next(3)).missed, true, "a wall is no object, where one was followed");
  const alone = new FrameLight(models, findMask, { on: [[0.1, 0.5]], off: [], box: null }, 65);
  assert.deepEqual(await alone.next(frameOf(50, 10, random), 0), { lost: true, width: WIDTH, height: HEIGHT });
});

test("a camera that is turned is looked at anew: nothing of its last pictures is kept", async () => {
  const random = numbers(5);
  let level = 0.5;
  const models = { light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(level) }) };
  const told = [];
  const findMask = async ({ rgba }, hints) => {
    told.push(hints);
    return foundIn(rgba);
  };
  const lights = new FrameLight(models, findMask, { on: [[0.5, 0.5]], off: [] }, 65);
  const landscape = () => frameOf(50, 10, random);
  const portrait = () => {
    const { layout, ...frame } = frameOf(50, 10, random);
    layout.forEach((plane) => (plane.stride *= HEIGHT / WIDTH));
    return { ...frame, layout, width: HEIGHT, height: WIDTH };
  };
  assert.ok((await lights.next(landscape(), 0)).mask);
  level = 0.52; // so near that a light of the same camera would move there slowly
  const turned = await lights.next(portrait(), 1 / 15);
  assert.deepEqual([turned.width, turned.height, turned.mask?.length], [HEIGHT, WIDTH, WIDTH * HEIGHT]);
  assert.deepEqual(told[1], { on: [], off: [], box: null });
  assert.ok(Math.abs(turned.light.radiance[0] - level) < 1e-6);
  assert.equal((await lights.next(portrait(), 2 / 15)).mask, null);
  lights.mark({ on: [[0.5, 0.5]], off: [], box: null });
  await lights.next(portrait(), 3 / 15);
  assert.deepEqual(told[2].on, [[HEIGHT / 2, WIDTH / 2]]);
});

test("the background is given to the network while that is wanted, and becomes part of the light", async () => {
  const given = [];
  const light = async (image, tanHalf, { surroundings }) => {
    given.push(surroundings !== null);
    return { radiance: new Float32Array(64 * 128 * 3).fill(0.5) };
  };
  const inside = Float32Array.from({ length: WIDTH * HEIGHT }, (_, i) => (i % WIDTH >= 50 && i % WIDTH < 110 ? 1 : 0));
  const lights = new FrameLight({ light, lifts: true }, async () => ({ mask: inside, quality: 0.9 }), { on: [], off: [] }, 65);
  const answers = [];
  for (const surroundings of [false, true, false]) {
    lights.options = { surroundings };
    answers.push(await lights.next(frameOf(10, 0, numbers(1)), answers.length * 10));
  }
  assert.deepEqual(given, [false, true, false]);
  assert.deepEqual(answers.map(({ light: { hints } }) => hints.surroundings > 0.01), [false, true, false]);
  const beside = 3 * (32 * 128 + 75); // 32 degrees to the right of the middle: the dark ground
  const [before, during] = answers.map(({ light: { radiance } }) => radiance[beside]);
  assert.ok(during < 0.5 * before, `${during} after ${before}`);
});

test("light sources are softened while that is wanted", async () => {
  const given = [];
  const light = async (image, tanHalf, { emitters }) => {
    given.push(emitters);
    return { radiance: new Float32Array(64 * 128 * 3).fill(0.5) };
  };
  const inside = new Float32Array(WIDTH * HEIGHT).fill(1);
  const lights = new FrameLight({ light, lifts: true }, async () => ({ mask: inside, quality: 0.9 }), { on: [], off: [] }, 65);
  const answers = [await lights.next(frameOf(10, 0, numbers(1)), 0)];
  lights.options = { emitters: "expected" };
  answers.push(await lights.next(frameOf(10, 0, numbers(1)), 1));
  assert.deepEqual(given, ["mode", "expected"]);
  assert.deepEqual(answers.map(({ light }) => light.emitters), given);
});

test("spheres and stages are made for those who show them alone", async () => {
  const models = { light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(0.5) }) };
  const lights = new FrameLight(models, async () => ({ mask: new Float32Array(WIDTH * HEIGHT).fill(1), quality: 0.9 }), { on: [], off: [] }, 65, {}, false);
  for (let i = 0; i < 9; i++) {
    const { spheres, stages } = await lights.next(frameOf(50, 0, numbers(1)), i / 15);
    assert.ok(!spheres && !stages);
  }
});

test("spheres, stages and mask come now and then", async () => {
  const models = { light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(0.5) }) };
  const inside = new Float32Array(WIDTH * HEIGHT).fill(1);
  const lights = new FrameLight(models, async () => ({ mask: inside, quality: 0.9 }), { on: [], off: [] }, 65);
  const kinds = [];
  for (let i = 0; i < 9; i++) {
    const { spheres, stages, mask } = await lights.next(frameOf(50, 0, numbers(1)), i / 15);
    kinds.push(`${spheres ? "spheres " : ""}${stages ? "stages " : ""}${mask ? "mask" : ""}`.trim());
  }
  assert.deepEqual(kinds, ["spheres mask", "", "", "", "stages", "", "", "", "spheres"]);
});

test("frames that are overtaken are dropped, the newest is worked on", async () => {
  const [worked, dropped] = [[], []];
  let release;
  const newest = new Newest(
    (item) => (worked.push(item), new Promise((resolve) => (release = resolve))),
    (item) => dropped.push(item),
  );
  const until = async (count) => {
    while (worked.length < count) await new Promise((resolve) => setTimeout(resolve));
  };
  for (const item of [1, 2, 3]) newest.offer(item);
  release();
  await until(2);
  newest.offer(4);
  release();
  await until(3);
  release();
  newest.offer(5);
  await until(4);
  assert.deepEqual(worked, [1, 3, 4, 5]);
  assert.deepEqual(dropped, [2]);
});
