/** The page's three spheres: what they show under a map, and at an exposure. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { MAP_HEIGHT } from "../src/core/latlong.js";
import { displayByte } from "../src/core/response.js";
import { SPHERE_NAMES, SPHERE_SIZE, displaySphere, shadeSpheres } from "../page/view/spheres.js";

const PIXELS = 2 * MAP_HEIGHT * MAP_HEIGHT;
const MIDDLE = (SPHERE_SIZE / 2) * SPHERE_SIZE + SPHERE_SIZE / 2;

/** A map of one radiance over the horizon and another below. */
function mapOf(above, below) {
  return Float32Array.from({ length: 3 * PIXELS }, (_, i) => (i < 1.5 * PIXELS ? above : below));
}

test("under an even map matte and mirror have its radiance, silver its reflectance of it", () => {
  const spheres = shadeSpheres(mapOf(0.3, 0.3));
  assert.deepEqual(Object.keys(spheres), SPHERE_NAMES);
  for (const [name, expected] of Object.entries({ matte: 0.3, silver: 0.27, mirror: 0.3 })) {
    assert.equal(spheres[name].length, 3 * SPHERE_SIZE ** 2);
    for (const value of spheres[name].subarray(3 * MIDDLE, 3 * MIDDLE + 3)) assert.ok(Math.abs(value - expected) < 1e-3, `${name} ${value}`);
  }
});

test("a light above is seen above, and doubling the light doubles every sphere", () => {
  const [once, twice] = [mapOf(1, 0), mapOf(2, 0)].map(shadeSpheres);
  const [top, bottom] = [0.2, 0.8].map((share) => 3 * (Math.floor(share * SPHERE_SIZE) * SPHERE_SIZE + SPHERE_SIZE / 2));
  for (const name of SPHERE_NAMES) {
    assert.ok(once[name][top] > 2 * once[name][bottom], name);
    assert.ok(once[name].every((value, i) => Math.abs(twice[name][i] - 2 * value) < 1e-5), name);
  }
});

test("a stop of exposure shows twice the radiance, clear around the sphere as before", () => {
  const { matte } = shadeSpheres(mapOf(0.2, 0.1));
  for (const exposureEv of [-2, 0, 1]) {
    const rgba = displaySphere(matte, exposureEv);
    assert.equal(rgba[4 * MIDDLE], displayByte(2 ** exposureEv * matte[3 * MIDDLE]));
    assert.deepEqual([rgba[3], rgba[4 * MIDDLE + 3]], [0, 255]);
  }
});
