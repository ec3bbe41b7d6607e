/** The virtual objects are those of the command line. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { SHAPES } from "../page/view/shapes.js";

/** Half extents of anyprobe.files.objects. */
const HALF = {
  sphere: [1, 1, 1],
  vase: [0.6541, 0.9045, 0.6541],
  pebble: [0.8091, 0.9783, 0.6902],
  block: [0.9418, 0.4573, 0.7602],
  solid: [0.903, 0.7305, 0.8382],
};

test("shapes are as wide, high and deep as the command line's, and closed outwards", () => {
  for (const [name, half] of Object.entries(HALF)) {
    const geometry = SHAPES[name]();
    geometry.computeBoundingBox();
    const { min, max } = geometry.boundingBox;
    const found = max.clone().sub(min).divideScalar(2).toArray();
    const ratio = Math.max(...half) / Math.max(...found);
    found.forEach((value, i) => assert.ok(Math.abs(value * ratio - half[i]) < 0.02, `${name}: ${found} ${half}`));
    const flat = geometry.index ? geometry.toNonIndexed() : geometry;
    const { position, normal } = flat.attributes;
    let [volume, along] = [0, 0];
    for (let i = 0; i < position.count; i += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => [position.getX(i + k), position.getY(i + k), position.getZ(i + k)]);
      const cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
      volume += (a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]) / 6;
      along += a[0] * normal.getX(i) + a[1] * normal.getY(i) + a[2] * normal.getZ(i);
    }
    assert.ok(volume > 0 && along > 0, `${name}: ${volume} ${along}`);
  }
});
