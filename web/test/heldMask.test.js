/** A mask is held where it was found, and moved with its object. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { follow, foundIn, hold, litMask, maskIn, narrowed } from "../src/live/heldMask.js";
import { ObjectFollower } from "../src/live/objectFollower.js";
import { isSure } from "../src/live/registration.js";

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
    held = follow(held, picture, found);
    assert.ok(iou(maskIn(held), mask) > 0.97, `${x}: ${iou(maskIn(held), mask)}`);
  }
});

test("an object looks other where its light changes, and where it changes back", async () => {
  let [held, same] = [hold(frame().picture, frame().mask), ""];
  for (let index = 1; index < 40; index++) {
    const { picture } = frame({ seed: index, lit: index >= 10 && index < 25 ? 0.4 : 0 });
    held = follow(held, picture, foundIn(held, picture));
    same += held.looksSame ? "y" : "n";
  }
  assert.deepEqual([same.indexOf("n"), same.indexOf("n", 15)], [9, 24], same);
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
  const follower = new ObjectFollower({ find, again, has: true }, { on: [[0.5, 0.5]], off: [], box: null });
  const masks = [];
  for (let at = 0; at < 5; at++) {
    const { picture } = frame({ seed: at + 1 });
    if (at === 2) picture.rgba.forEach((_, i) => (picture.rgba[i] = (i * 7919) % 251)); // nothing of the object
    masks.push((await follower.next(picture)).mask);
  }
  assert.equal(looked.length, 1);
  const [[x, y], [x0, y0, x1, y1]] = [looked[0].on[0], looked[0].box];
  assert.ok(x > 130 && x < 170 && y > 100 && y < 140, "well inside it");
  [x0 - (101 - 8), y0 - (81 - 6.3), x1 - (200 + 8), y1 - (160 + 6.3)].forEach((off) => assert.ok(Math.abs(off) < 3, `its box and a margin: ${looked[0].box}`));
  assert.ok(iou(masks[1], masks[2]) < 0.8);
  assert.ok(iou(masks[1], masks[3]) > 0.98);
  assert.ok(iou(masks[1], masks[4]) > 0.98);
});
