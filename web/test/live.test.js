/** The camera's frames become lights: always the newest, its mask moved with the object. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { inverseResponse } from "../src/core/response.js";
import { FrameLight } from "../src/live/frameLight.js";
import { Newest } from "../src/live/newest.js";
import { said } from "./said.js";

const [WIDTH, HEIGHT] = [160, 120];

/** A bright square on a dark ground, with the camera's noise, as a texture's memory: its lowest row first. */
function frameOf(left, noise, random, shade = () => 180) {
  const bytes = new Uint8Array(4 * WIDTH * HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const [x, y] = [i % WIDTH, Math.floor(i / WIDTH)];
    const isInside = x >= left && x < left + 60 && y >= 30 && y < 90;
    bytes.fill((isInside ? shade(x - left) : 90) + noise * (random() - 0.5), 4 * i, 4 * i + 4);
  }
  return { width: WIDTH, height: HEIGHT, bytes };
}

/** Numbers in [0, 1) that are the same in every run. */
function numbers(seed) {
  return () => (seed = (seed * 16807) % 2147483647) / 2147483647;
}

/** What is bright. */
const foundIn = (rgba) => ({ mask: Float32Array.from({ length: rgba.length / 4 }, (_, i) => (rgba[4 * i] > 120 ? 1 : 0)), quality: 0.9 });

const degrees = (a, b) => (Math.acos(Math.min(a.reduce((sum, value, i) => sum + value * b[i], 0), 1)) * 180) / Math.PI;

/** Ways to find masks, all of them this one. */
const masksBy = (find) => ({ find, again: find, has: true });
const noHints = { on: [], off: [], box: null };

/** What was asked for in so many frames, and the left and right border of each mask that was told. */
async function follow(count, leftOf, markAt = -1, hints = { on: [[0.5, 0.5]], off: [], box: null }) {
  const random = numbers(5);
  const models = { light: async () => said(0.5) };
  const seen = { found: [], again: [], hints: [], borders: [] };
  let at = 0;
  const by = (list) => async ({ rgba }, told) => {
    list.push(at);
    seen.hints.push(told);
    return foundIn(rgba);
  };
  const masks = { find: by(seen.found), again: by(seen.again), has: true };
  const lights = new FrameLight(models, masks, noHints, 65);
  for (; at < count; at++) {
    if (at === markAt) lights.mark(hints);
    const { mask } = await lights.next(frameOf(leftOf(at), 10, random), at / 15);
    const row = [...mask.subarray(60 * WIDTH, 61 * WIDTH)].map((value) => value > 0.5);
    seen.borders.push([row.indexOf(true), row.lastIndexOf(true) + 1]);
  }
  return seen;
}

test("the mask is found once, and moved in every frame", async () => {
  for (const leftOf of [(at) => 20 + at, (at) => (at < 5 ? 50 : 56)]) {
    const { found, again, borders } = await follow(10, leftOf);
    assert.deepEqual([found, again], [[0], []]);
    borders.forEach(([left, right], at) => {
      assert.ok(Math.abs(left - leftOf(at)) <= 1 && Math.abs(right - left - 60) <= 2, `${at}: ${left} to ${right}`);
    });
  }
});

test("networks look four times a second while the object looks the same, at each frame again once it looks other", async () => {
  const random = numbers(5);
  const looks = [];
  let at = 0;
  const light = async () => {
    looks.push(at);
    return said(0.5);
  };
  const lights = new FrameLight({ light }, masksBy(async ({ rgba }) => foundIn(rgba)), noHints, 65, {}, false);
  lights.mark({ on: [[0.5, 0.5]], off: [], box: null });
  const shades = [(x) => 130 + x, (x) => 190 - x];
  for (; at < 60; at++) {
    const { light, mask } = await lights.next(frameOf(50, 4, random, shades[at < 45 ? 0 : 1]), at / 15);
    assert.ok(mask && light.confidence.length, `${at}`);
    structuredClone(light.confidence, { transfer: [light.confidence.buffer] });
  }
  const among = (from, to) => looks.filter((one) => one >= from && one < to).length;
  assert.equal(among(0, 10), 10, looks.join());
  assert.equal(among(13, 45), 8, looks.join());
  assert.equal(among(45, 52), 7, looks.join());
});

test("a click is looked for at once", async () => {
  const { found } = await follow(12, () => 50, 7);
  assert.deepEqual(found, [0, 7]);
});

test("lights of the object before go on while what was marked is looked for, which is then followed to where it is", async () => {
  const random = numbers(5);
  const models = { light: async () => said(0.5) };
  let answer;
  const findMask = ({ rgba }) => new Promise((resolve) => (answer = () => resolve(foundIn(rgba))));
  const lights = new FrameLight(models, masksBy(findMask), { on: [], off: [] }, 65);
  const next = async (at) => {
    const told = await lights.next(frameOf(50 + 2 * at, 10, random), at / 15);
    return { searching: told.searching, left: told.mask.subarray(60 * WIDTH, 61 * WIDTH).findIndex((value) => value > 0.5) };
  };
  const first = next(0);
  answer();
  assert.deepEqual(await first, { searching: undefined, left: 50 });
  lights.mark({ on: [[0.5, 0.5]], off: [] });
  for (const at of [1, 2, 3]) {
    const { searching, left } = await next(at);
    assert.ok(searching && Math.abs(left - 50 - 2 * at) <= 1, `${at}: ${left}`);
  }
  answer();
  await new Promise((resolve) => setTimeout(resolve));
  const { searching, left } = await next(4);
  assert.ok(!searching && Math.abs(left - 58) <= 1, `${left}`);
});

test("a box is told in pixels", async () => {
  const { hints } = await follow(7, (at) => 20 + at, 5, { on: [], off: [], box: [0.25, 0.25, 0.75, 1] });
  assert.deepEqual(hints[1], { on: [], off: [], box: [0.25 * WIDTH, 0.25 * HEIGHT, 0.75 * WIDTH, HEIGHT] });
});

test("the light of a still object before a still camera does not creep, though each look finds another mask", async () => {
  const random = numbers(5);
  const wider = ({ rgba }) => ({ mask: Float32Array.from({ length: rgba.length / 4 }, (_, i) => (i % WIDTH >= 44 && i % WIDTH < 112 && i >= 30 * WIDTH && i < 90 * WIDTH ? 1 : 0)), quality: 0.9 });
  const light = async ({ window: [values] }) => {
    let cover = 0; // a wider mask turns the light
    for (let at = 3; at < values.length; at += 4) cover += values[at];
    const radiance = new Float32Array(64 * 128 * 3).fill(0.1);
    for (let row = 20; row < 24; row++) for (let x = 0; x < 4; x++) radiance.fill(20, 3 * (row * 128 + Math.round(cover / 100) + x), 3 * (row * 128 + Math.round(cover / 100) + x + 1));
    return said(0.5, { radiance });
  };
  const masks = { find: async ({ rgba }) => foundIn(rgba), again: async (picture) => wider(picture), has: true };
  const lights = new FrameLight({ light }, masks, { on: [[0.5, 0.5]], off: [], box: null }, 65, {}, false);
  const directions = [];
  for (let at = 0; at < 90; at++) directions.push((await lights.next(frameOf(50, 10, random), at / 15)).light.dominant.direction);
  const turnedDeg = directions.map((one) => degrees(one, directions[5]));
  assert.ok(Math.max(...turnedDeg.slice(5)) < 3, `turned by ${Math.max(...turnedDeg.slice(5)).toFixed(1)} degrees`);
});

test("the outline is told before the light, of the same frame", async () => {
  const order = [];
  const light = async () => (order.push("light"), said(0.5));
  const lights = new FrameLight({ light }, masksBy(async ({ rgba }) => foundIn(rgba)), { on: [[0.5, 0.5]], off: [], box: null }, 65);
  const told = await new Promise((resolve) => lights.next(frameOf(50, 10, numbers(5)), 3, null, null, (outline) => (order.push("outline"), resolve(outline))));
  assert.deepEqual([order[0], told.time, told.width, told.box[0], told.light], ["outline", 3, WIDTH, 50, undefined]);
});

test("a mask of the caller's own is taken as it is, frames without one move it, and no network is asked", async () => {
  const random = numbers(5);
  const models = { light: async () => said(0.5) };
  const find = () => assert.fail("asked");
  const lights = new FrameLight(models, { find, again: find, has: false }, noHints, 65);
  const half = { width: WIDTH / 2, height: HEIGHT / 2 };
  const data = Float32Array.from({ length: half.width * half.height }, (_, i) => {
    const [x, y] = [2 * (i % half.width), 2 * Math.floor(i / half.width)];
    return x >= 50 && x < 110 && y >= 30 && y < 90 ? 1 : 0;
  });
  const borders = [];
  for (let at = 0; at < 4; at++) {
    const { mask, quality } = await lights.next(frameOf(50 + 2 * at, 10, random), at / 15, null, at === 0 ? { ...half, data } : null);
    const row = [...mask.subarray(60 * WIDTH, 61 * WIDTH)].map((value) => value > 0.5);
    borders.push(row.indexOf(true));
    assert.equal(quality, null);
  }
  borders.forEach((left, at) => assert.ok(Math.abs(left - 50 - 2 * at) <= 1, `${at}: ${left}`));
  const empty = { ...half, data: new Float32Array(data.length) };
  assert.equal((await lights.next(frameOf(50, 10, random), 1, null, empty)).light, undefined, "a mask without an object is none");
});

test("a frame in which nothing can be seen keeps the last light, and many of them lose the object", async () => {
  const random = numbers(5);
  const models = { light: async () => said(0.5) };
  let isDark = false;
  const masks = masksBy(async ({ rgba }) => (isDark ? { mask: new Float32Array(rgba.length / 4), quality: 0 } : foundIn(rgba)));
  const lights = new FrameLight(models, masks, noHints, 65);
  const next = (at) => lights.next(isDark ? { ...frameOf(50, 10, random), bytes: new Uint8Array(4 * WIDTH * HEIGHT) } : frameOf(50, 10, random), at / 15);
  assert.ok((await next(0)).light);
  isDark = true;
  for (let at = 1; at < 8; at++) assert.equal((await next(at)).held, true);
  assert.equal((await next(8)).lost, true);
  isDark = false;
  assert.ok((await next(9)).light);
});

test("where a click finds nothing the object before it is followed on", async () => {
  const random = numbers(5);
  const models = { light: async () => said(0.5) };
  const told = [];
  const findMask = async ({ rgba }, hints) => {
    told.push(hints);
    const found = foundIn(rgba);
    const [[x] = [80]] = hints.on;
    if (x > 145) return { mask: found.mask.map((_, i) => (i % WIDTH > 138 && i < 20 * WIDTH ? 1 : 0)), quality: 0.9 };
    if (x > 20 && x < 50) return { ...found, quality: 0.01 };
    return x < 50 ? { mask: new Float32Array(found.mask.length), quality: 0 } : found;
  };
  const lights = new FrameLight(models, masksBy(findMask), { on: [[0.5, 0.5]], off: [], box: null }, 65);
  const next = (at) => lights.next(frameOf(50, 10, random), at / 15);
  assert.ok((await next(0)).mask);
  lights.mark({ on: [[0.1, 0.5]], off: [], box: null });
  const missed = await next(1);
  assert.deepEqual([missed.missed, missed.lost, told.length], [true, undefined, 2]);
  assert.ok(missed.mask);
  assert.equal((await next(2)).missed, undefined);
  lights.mark({ on: [[0.2, 0.5]], off: [], box: null });
  assert.equal((await next(3)).missed, true, "a wall is no object, where one was followed");
  lights.mark({ on: [[0.95, 0.1]], off: [], box: null });
  const small = await next(4);
  assert.deepEqual([small.missed, small.lost, small.mask?.length], [true, undefined, WIDTH * HEIGHT], "nor is what estimate refuses as too small");
  assert.ok((await next(5)).mask);
  const alone = new FrameLight(models, masksBy(findMask), { on: [[0.1, 0.5]], off: [], box: null }, 65);
  const { mean, ...lost } = await alone.next(frameOf(50, 10, random), 0);
  assert.deepEqual(lost, { lost: true, width: WIDTH, height: HEIGHT });
  assert.ok(mean.every((value) => value > inverseResponse(90 / 255) && value < inverseResponse(180 / 255)), mean.join());
});

test("a camera that is turned is looked at anew: nothing of its last pictures is kept", async () => {
  const random = numbers(5);
  let level = 0.5;
  const models = { light: async () => said(level) };
  const told = [];
  const findMask = async ({ rgba }, hints) => {
    told.push(hints);
    return foundIn(rgba);
  };
  const lights = new FrameLight(models, masksBy(findMask), { on: [[0.5, 0.5]], off: [] }, 65);
  const landscape = () => frameOf(50, 10, random);
  const portrait = () => ({ ...frameOf(50, 10, random), width: HEIGHT, height: WIDTH });
  assert.ok((await lights.next(landscape(), 0)).mask);
  level = 0.52; // so near that a light of the same camera would move there slowly
  const turned = await lights.next(portrait(), 1 / 15);
  assert.deepEqual([turned.width, turned.height, turned.mask?.length], [HEIGHT, WIDTH, WIDTH * HEIGHT]);
  assert.deepEqual(told[1], { on: [], off: [], box: null });
  assert.ok(Math.abs(turned.light.radiance[0] - level) < 1e-6);
  await lights.next(portrait(), 2 / 15);
  lights.mark({ on: [[0.5, 0.5]], off: [], box: null });
  await lights.next(portrait(), 3 / 15);
  assert.ok(told.some(({ on: [[x, y] = []] }) => x === HEIGHT / 2 && y === WIDTH / 2));
});

test("the background is given to the network while that is wanted", async () => {
  const given = [];
  const light = async ({ photo: [values], believe: [[believe]] }) => {
    given.push([values.some((value, i) => i % 5 === 3 && value > 0 && values[i + 1] === 0), believe]);
    return said(0.5);
  };
  const inside = Float32Array.from({ length: WIDTH * HEIGHT }, (_, i) => (i % WIDTH >= 50 && i % WIDTH < 110 ? 1 : 0));
  const lights = new FrameLight({ light }, masksBy(async () => ({ mask: inside, quality: 0.9 })), { on: [], off: [] }, 65);
  for (const surroundings of [false, true, "auto"]) {
    lights.options = { surroundings };
    await lights.next(frameOf(10, 0, numbers(1)), given.length * 10);
  }
  assert.deepEqual(given, [[false, 0], [true, 1], [true, 0]]);
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
