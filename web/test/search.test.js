/** Which object is meant, with a network that is drawn: what is red stands out. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { untilGivenUp } from "../src/photo/maskNetworks.js";
import { doubtOf, expectedIou } from "../src/photo/quality.js";
import { resize } from "../src/photo/resize.js";
import { Looks, findObject, maskOf } from "../src/photo/search.js";

const [WIDTH, HEIGHT] = [320, 240];
const NOTHING = { on: [], off: [], box: null };

/** @param {number} [least] share of the picture that must be red */
const redness = (least = 0) => ({
  name: "u2netp",
  takesPrompts: false,
  async cover({ width, height, rgba }) {
    const small = resize(rgba, 4, [width, height], [320, 320]);
    const values = Float32Array.from({ length: 320 * 320 }, (_, i) => Math.min(Math.max((small[4 * i] - small[4 * i + 2]) / 127, 0), 1));
    const share = values.reduce((sum, value) => sum + (value > 0.5 ? 1 : 0), 0) / values.length;
    return { values: share > least ? values : values.fill(0), width: 320, height: 320 };
  },
});

const disc = (x, y, radius) =>
  Uint8Array.from({ length: WIDTH * HEIGHT }, (_, i) => (Math.hypot((i % WIDTH) + 0.5 - x, Math.floor(i / WIDTH) + 0.5 - y) < radius ? 1 : 0));

function photo(...objects) {
  const rgba = new Uint8ClampedArray(4 * WIDTH * HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const which = objects.findIndex((object) => object[i]);
    rgba.set(which < 0 ? [77, 90, 102, 255] : which ? [240, 130, 26, 255] : [230, 51, 26, 255], 4 * i);
  }
  return { width: WIDTH, height: HEIGHT, rgba };
}

function iou(mask, object) {
  let [both, either] = [0, 0];
  mask.forEach((value, i) => {
    if (value > 0.5 && object[i]) both++;
    if (value > 0.5 || object[i]) either++;
  });
  return both / either;
}

async function found(picture, hints, network = redness()) {
  const finding = await findObject(new Looks(network, picture), { ...NOTHING, ...hints });
  return finding && maskOf(finding, WIDTH, HEIGHT);
}

const [LARGE, LITTLE] = [disc(100, 110, 60), disc(250, 150, 30)];

test("without hints the largest part is the object, clicks choose and take away, a box clips", async () => {
  const picture = photo(LARGE, LITTLE);
  assert.ok(iou(await found(picture, {}), LARGE) > 0.97);
  assert.ok(iou(await found(picture, { on: [[250, 150]] }), LITTLE) > 0.95);
  assert.ok(iou(await found(picture, { off: [[100, 110]] }), LITTLE) > 0.95);
  const boxed = await found(picture, { box: [30, 40, 140, 200] });
  assert.ok(boxed[110 * WIDTH + 138] > 0.5 && boxed[110 * WIDTH + 143] < 0.5);
});

test("a click finds what stands out in a window around it alone", async () => {
  const picture = photo(LITTLE);
  assert.equal(await found(picture, {}, redness(0.1)), null);
  assert.ok(iou(await found(picture, { on: [[250, 150]] }, redness(0.1)), LITTLE) > 0.95);
});

test("an excluding click on the one part cuts it along colours", async () => {
  const [left, right] = [disc(110, 120, 50), disc(200, 120, 45)];
  const picture = photo(left, right);
  assert.ok(iou(await found(picture, { on: [[100, 120]], off: [[215, 120]] }), left) > 0.9);
  assert.ok(iou(await found(picture, { off: [[215, 120]] }), left) > 0.9);
});

test("what speaks against a mask lowers what to expect, and is named", async () => {
  const good = await findObject(new Looks(redness(), photo(LARGE)), NOTHING);
  const bad = { ...good, flat: 0.3, cut: 0.3 };
  assert.ok(expectedIou(good) > 0.9 && expectedIou(bad) < expectedIou(good) - 0.4);
  assert.match(doubtOf({ ...good, flat: 0.3 }), /hardly changes/);
  assert.match(doubtOf(bad), /box cuts/);
  assert.match(doubtOf({ ...good, cover: good.cover.map((value) => value / 2) }), /blurred/);
});

test("an outline across which the picture hardly changes is doubted", async () => {
  const network = redness();
  const certain = { ...network, cover: async (seen) => ({ ...(await network.cover(seen)), values: (await network.cover(seen)).values.map((value) => (value > 0.5 ? 1 : 0)) }) };
  const fading = photo(LARGE);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const share = Math.min(Math.max(1.2 - (2.4 * (i % WIDTH)) / (WIDTH - 1), 0), 1);
    [77, 90, 102].forEach((wall, c) => (fading.rgba[4 * i + c] = wall + share * (fading.rgba[4 * i + c] - wall)));
  }
  const [whole, half] = [await findObject(new Looks(certain, photo(LARGE)), NOTHING), await findObject(new Looks(certain, fading), NOTHING)];
  assert.ok(whole.flat === 0 && expectedIou(whole) > 0.9);
  assert.ok(half.flat > 0.2 && expectedIou(half) < expectedIou(whole) - 0.15, `${half.flat}`);
  assert.match(doubtOf(half), /hardly changes/);
});

test("a further click takes no look where one before shows the object", async () => {
  const network = redness();
  let count = 0;
  const looks = new Looks({ ...network, cover: (...given) => (count++, network.cover(...given)) }, photo(LARGE, LITTLE, disc(20, 20, 8)));
  const counts = [];
  for (const on of [[], [[100, 110]], [[250, 150]], [[100, 110], [250, 150]], [[20, 20]]]) {
    await findObject(looks, { ...NOTHING, on });
    counts.push(count);
  }
  assert.deepEqual(counts, [2, 2, 2, 2, 3]); // what is small in them is looked at closer
});

test("a click on what the whole look missed takes two looks more", async () => {
  const network = redness(0.1);
  let count = 0;
  const looks = new Looks({ ...network, cover: (...given) => (count++, network.cover(...given)) }, photo(disc(250, 150, 45)));
  await findObject(looks, { ...NOTHING, on: [[250, 150]] });
  assert.equal(count, 3);
});

test("a further click on what was found around the last one takes no look", async () => {
  const network = redness(0.1);
  let count = 0;
  const looks = new Looks({ ...network, cover: (...given) => (count++, network.cover(...given)) }, photo(LITTLE));
  const first = await findObject(looks, { ...NOTHING, on: [[250, 150]] });
  const taken = count;
  for (const on of [[[250, 150], [240, 145]], [[262, 160]]]) {
    const again = await findObject(looks, { ...NOTHING, on });
    assert.deepEqual([count, again.window], [taken, first.window]);
  }
  await findObject(looks, { ...NOTHING, on: [[40, 150]] });
  assert.ok(count > taken, "elsewhere it looks");
});

test("what a box cuts off is known", async () => {
  const looks = new Looks(redness(), photo(LARGE));
  const cut = async (box) => (await findObject(looks, { ...NOTHING, box })).cut;
  assert.equal(await cut([30, 40, 170, 180]), 0);
  assert.ok(Math.abs((await cut([30, 40, 100, 180])) - 0.27) < 0.02); // its straight side over the perimeter, in cells
});

test("a search that is given up looks no more", async () => {
  let [looks, isGivenUp] = [0, false];
  const network = redness();
  const counted = { ...network, cover: (...given) => (looks++, network.cover(...given)) };
  const picture = photo(disc(90, 120, 25));
  await findObject(new Looks(untilGivenUp(counted, () => isGivenUp), picture), NOTHING);
  assert.ok(looks > 1, `${looks}`);
  looks = 0;
  setTimeout(() => (isGivenUp = true)); // as a message that comes while the first look is under way
  await assert.rejects(findObject(new Looks(untilGivenUp(counted, () => isGivenUp), picture), NOTHING), /given up/);
  assert.ok(looks <= 1, `${looks}`);
});
