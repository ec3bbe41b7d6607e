/** A mask is held where it was found, and moved with its object: the cases of tests/product/test_held_mask.py. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { CONTRACT } from "../src/core/contract.js";
import { follow, foundIn, hold, litMask, maskIn, narrowed } from "../src/live/heldMask.js";
import { innerPoint, ObjectFollower } from "../src/live/objectFollower.js";
import { isSure } from "../src/live/registration.js";

const { every: EVERY, every_sure: EVERY_SURE, every_refused: EVERY_REFUSED, patience: PATIENCE } = CONTRACT.held_mask;
const [WIDTH, HEIGHT] = [300, 240];

/** A textured ellipse before a bright wall, so far from the middle, and what it covers. */
function frame({ x = 0, y = 0, seed = 1, lit = 0 } = {}) {
  const rgba = new Uint8ClampedArray(4 * WIDTH * HEIGHT).fill(255);
  const mask = new Float32Array(WIDTH * HEIGHT);
  for (let i = 0; i < mask.length; i++) {
    const [u, v] = [(i % WIDTH) - 150 - x, Math.floor(i / WIDTH) - 120 - y];
    mask[i] = (u / 50) ** 2 + (v / 40) ** 2 < 1 ? 1 : 0;
    seed = (seed * 16807) % 2147483647;
    const noise = (4 * seed) / 2147483647;
    const value = mask[i] ? 90 + 40 * Math.sin(u / 7) * Math.cos(v / 9) + 20 * Math.sin((u + 2 * v) / 5) + lit * u : 225;
    rgba.fill(value + noise, 4 * i, 4 * i + 3);
  }
  return { picture: { width: WIDTH, height: HEIGHT, rgba }, mask };
}

const shifted = (mask, across, down = 0) => Float32Array.from(mask, (_, i) => mask[i - across - down * WIDTH] ?? 0);
const total = (mask) => mask.reduce((sum, value) => sum + value, 0);

function iou(one, other) {
  let [both, either] = [0, 0];
  for (let i = 0; i < one.length; i++) {
    both += one[i] > 0.5 && other[i] > 0.5;
    either += one[i] > 0.5 || other[i] > 0.5;
  }
  return both / either;
}

test("the mask goes where its object does, also beyond the window it was found in", async () => {
  let held = hold(frame().picture, frame().mask);
  for (const x of [10, 25, 45, 70, 80]) {
    const { picture, mask } = frame({ x, y: -x / 4, seed: x });
    const found = foundIn(held, picture);
    assert.ok(isSure(found), String(x));
    held = await follow(held, picture, found, null);
    assert.ok(iou(maskIn(held), mask) > 0.97, `${x}: ${iou(maskIn(held), mask)}`);
  }
});

test("an object looks other where its light changes, and where it changes back", async () => {
  let [held, same] = [hold(frame().picture, frame().mask), ""];
  for (let index = 1; index < 40; index++) {
    const { picture } = frame({ seed: index, lit: index >= 10 && index < 25 ? 0.4 : 0 });
    held = await follow(held, picture, foundIn(held, picture), null);
    same += held.looksSame ? "y" : "n";
  }
  assert.deepEqual([same.indexOf("n"), same.indexOf("n", 15)], [9, 24], same);
});

test("a mask that does not agree counts when it stays so, and another object's never", async () => {
  const { picture, mask } = frame();
  const wide = mask.slice();
  for (let y = 78; y < 160; y++) wide.fill(1, y * WIDTH + 180, y * WIDTH + 215); // a handle that was never there
  const masks = [wide, shifted(wide, 0, 60), ...Array(PATIENCE).fill(wide)];
  let [held, asked] = [hold(picture, mask), 0];
  const last = EVERY + (PATIENCE + 1) * EVERY_REFUSED;
  for (let count = 1; count <= last; count++) {
    held = await follow(held, picture, foundIn(held, picture), async () => masks[asked++]);
    assert.ok(iou(maskIn(held), count === last ? wide : mask) > 0.98, `frame ${count}`);
  }
  assert.equal(asked, PATIENCE + 2);
  const huge = new Float32Array(mask.length).fill(1);
  held = hold(picture, mask);
  for (let count = 0; count < 6 * EVERY; count++) held = await follow(held, picture, foundIn(held, picture), async () => huge);
  assert.ok(iou(maskIn(held), mask) > 0.99);
});

test("the longer masks agree, the less often is one looked for", async () => {
  const { picture, mask } = frame();
  const masks = [mask, mask, mask, shifted(mask, 20), mask];
  let [held, looks] = [hold(picture, mask), []];
  for (let count = 1; count < 13 * EVERY; count++) {
    held = await follow(held, picture, foundIn(held, picture), async () => (looks.push(count), masks[looks.length - 1]));
  }
  const waits = [EVERY, 2 * EVERY, EVERY_SURE, EVERY_SURE, EVERY_REFUSED];
  assert.deepEqual(looks, waits.map((_, i) => waits.slice(0, i + 1).reduce((a, b) => a + b)));
});

test("masks that agree are averaged", async () => {
  const { picture, mask } = frame();
  let held = hold(picture, mask);
  for (let count = 0; count < EVERY; count++) held = await follow(held, picture, foundIn(held, picture), async () => shifted(mask, 2));
  assert.equal(held.finds, 2);
  const other = shifted(mask, 2);
  const now = maskIn(held);
  assert.ok(mask.every((value, i) => Math.abs(now[i] - (value + other[i]) / 2) < 0.2));
});

test("a mask is narrowed, by more where the motion is less sure", () => {
  const { picture, mask } = frame();
  assert.equal(narrowed(mask, WIDTH, 0), mask);
  const sizes = [0, 0.6, 1, 1.6, 2].map((pixels) => total(narrowed(mask, WIDTH, pixels)));
  for (let i = 1; i < sizes.length; i++) assert.ok(sizes[i] < sizes[i - 1]);
  const held = hold(picture, mask);
  const [whole, sure, unsure] = [maskIn(held), litMask(held), litMask({ ...held, errorPx: 1.5 })].map(total);
  assert.ok(unsure < sure && sure < whole);
});

test("one odd frame changes nothing after it", async () => {
  const looked = [];
  const find = async () => ({ mask: frame().mask, quality: 0.9 });
  const again = async (_, hints) => {
    looked.push(hints);
    return { mask: shifted(frame().mask, 30), quality: 0.9 };
  };
  const follower = new ObjectFollower({ find, again, has: true, checks: true }, { on: [[0.5, 0.5]], off: [], box: null });
  const masks = [];
  for (let at = 0; at < 5; at++) {
    const { picture } = frame({ seed: at + 1 });
    if (at === 2) picture.rgba.forEach((_, i) => (picture.rgba[i] = (i * 7919) % 251)); // nothing of the object
    masks.push((await follower.next(picture)).mask);
  }
  assert.equal(looked.length, 1);
  assert.ok(iou(masks[1], masks[2]) < 0.8);
  assert.ok(iou(masks[1], masks[3]) > 0.98);
  assert.ok(iou(masks[1], masks[4]) > 0.98);
});

test("the inner point is the middle of what is left longest", () => {
  const mask = Float32Array.from({ length: 200 * 100 }, (_, i) => ((i % 200) > 20 && (i % 200) < 80 && i > 20 * 200 && i < 80 * 200 ? 1 : 0));
  const [x, y] = innerPoint(mask, 200);
  assert.ok(Math.abs(x - 50) <= 3 && Math.abs(y - 50) <= 3, `${x}, ${y}`);
});
