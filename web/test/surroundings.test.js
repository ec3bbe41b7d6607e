/** What is seen in the place of the prediction, as anyprobe.estimate.surroundings has it. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { luminance } from "../src/core/color.js";
import { inverseResponse, response } from "../src/core/response.js";
import { lightOfObject } from "../src/networks/lightOfObject.js";
import { backdropDoubts, isDarkBeside } from "../src/photo/backdrop.js";
import { cropObject } from "../src/photo/crop.js";
import { useSurroundings } from "../src/photo/surroundings.js";

const PIXELS = 64 * 128;
const WHITE = 0.97;

/** The first pixel where a photo shows display values `shown` there, and grey elsewhere, and `lamp` was predicted everywhere. */
function seenFor(shown, lamp) {
  const surroundings = new Float32Array(4 * PIXELS);
  const radiance = Float32Array.from({ length: 3 * PIXELS }, (_, i) => lamp[i % 3]);
  for (let channel = 0; channel < 3; channel++) surroundings[channel * PIXELS] = shown[channel];
  surroundings[3 * PIXELS] = 1;
  return [...useSurroundings({ radiance }, surroundings).radiance.slice(0, 3)];
}

function assertHue(found, shown) {
  const seen = shown.map(inverseResponse);
  for (let c = 0; c < 3; c++) {
    assert.ok(Math.abs(found[c] / found[1] - seen[c] / seen[1]) < 1e-4, `${found}`);
    assert.ok(found[c] >= seen[c] - 1e-5, `${found}`);
  }
}

for (const shown of [[0.5, 0.7, 1], [0.6, 0.98, 0.6], [0.99, 1, 0.8]]) {
  test(`${shown} keeps its hue, whatever light source was predicted there`, () => {
    const found = seenFor(shown, [30, 20, 10]);
    assertHue(found, shown);
    const most = Math.max(...found.filter((_, c) => shown[c] < WHITE).map(response));
    assert.ok(Math.abs(most - WHITE) < 1e-3, `${found}`); // what is not clipped does not become it
    const dark = seenFor(shown, [0.1, 0.1, 0.1]);
    dark.forEach((value, c) => assert.ok(Math.abs(value - inverseResponse(shown[c])) < 1e-4, `${dark}`));
  });
}

test("what is clipped altogether is as bright as the prediction", () => {
  const shown = [1, 1, 0.98];
  const found = seenFor(shown, [20, 20, 20]);
  assertHue(found, shown);
  assert.ok(Math.abs(luminance(...found) - 20) < 0.5, `${found}`);
});

test("a backdrop that is not used is said; the black of a cut-out and transparency are not", () => {
  const picture = (grey, alpha) => {
    const rgba = new Uint8ClampedArray(4 * 64 * 48).fill(grey);
    for (let i = 3; i < rgba.length; i += 4) rgba[i] = alpha;
    return { width: 64, height: 48, rgba };
  };
  const mask = new Float32Array(64 * 48).fill(1, 0, 640);
  assert.equal(backdropDoubts(picture(250, 255), mask)[0].code, "plain-backdrop");
  assert.deepEqual(backdropDoubts(picture(0, 255), mask), []);
  assert.deepEqual(backdropDoubts(picture(250, 0), mask), []);
  assert.deepEqual(backdropDoubts(picture(250, 255), mask.fill(1)), []);
});

test("a dark background that is not used is said", async () => {
  const [width, height] = [160, 120];
  const mask = new Float32Array(width * height);
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let i = 0; i < mask.length; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    mask[i] = Number(Math.hypot(x - 80, y - 60) < 20);
    rgba.set(mask[i] ? [200, 200, 200, 255] : [x % 40, 20, y % 40, 255], 4 * i);
  }
  const picture = { width, height, rgba };
  const models = { lifts: true, light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(0.4) }) };
  const codes = async (surroundings) => {
    const { warnings } = await lightOfObject(models, picture, 60, cropObject(picture, mask, 60), { surroundings });
    return warnings.map(({ code }) => code);
  };
  assert.deepEqual(await codes("auto"), ["dark-backdrop"]);
  assert.ok(!(await codes("photo")).includes("dark-backdrop"));
});

test("a background tints what it does not show, unless the object's material is known", async () => {
  const [width, height] = [160, 120];
  const rgba = new Uint8ClampedArray(4 * width * height);
  const mask = new Float32Array(width * height);
  for (let i = 0; i < mask.length; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    rgba.set([200 - (x % 40), 120, 60 + (y % 40), 255], 4 * i); // a warm room
    if (Math.hypot(x - 80, y - 60) < 20) mask[i] = 1;
  }
  const picture = { width, height, rgba };
  const models = { lifts: true, light: async () => ({ radiance: new Float32Array(64 * 128 * 3).fill(0.4) }) };
  const behind = async (material) => {
    const { radiance } = await lightOfObject(models, picture, 60, cropObject(picture, mask, 60), { surroundings: "photo", material });
    return [...radiance.subarray(3 * 32 * 128, 3 * 32 * 128 + 3)];
  };
  const [red, , blue] = await behind(undefined);
  assert.ok(red > 1.1 * blue, `${red}, ${blue}`);
  const [plainRed, , plainBlue] = await behind(new Float32Array(8)); // but for what goes on from far away
  assert.ok(Math.abs(plainRed / plainBlue - 1) < 0.08, `${plainRed}, ${plainBlue}`);
});

for (const [beside, isDark] of [[50, true], [60, false]]) {
  test(`surroundings of ${beside} beside an object of 160 are ${isDark ? "" : "not "}dark`, () => {
    const [width, height] = [40, 30];
    const mask = Float32Array.from({ length: width * height }, (_, i) => (i % width < 10 ? 1 : 0));
    const rgba = new Uint8ClampedArray(4 * width * height).map((_, i) => (i % 4 === 3 ? 255 : mask[i >> 2] ? 160 : beside));
    assert.equal(isDarkBeside({ width, height, rgba }, mask), isDark);
  });
}
