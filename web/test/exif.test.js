/** The lens that a photo's file notes. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { exifFovDeg } from "../src/files/exif.js";
import { lensOf } from "../src/photo/lens.js";

/** Exif whose 35 mm equivalent is this, of either byte order, after what its container has before it. */
function fileOf(before, focal, isLittle) {
  const exif = new DataView(new ArrayBuffer(64));
  const put = (at, value, bytes) => exif[`setUint${8 * bytes}`](at, value, isLittle);
  exif.setUint16(0, isLittle ? 0x4949 : 0x4d4d);
  put(2, 42, 2);
  put(4, 8, 4);
  const tag = (at, name, kind, value) => {
    put(at, name, 2);
    put(at + 2, kind, 2);
    put(at + 4, 1, 4);
    put(at + 8, value, kind === 3 ? 2 : 4);
  };
  put(8, 1, 2);
  tag(10, 0x8769, 4, 30);
  put(30, 1, 2);
  tag(32, 0xa405, 3, focal);
  return new Blob([before, exif]);
}

test("a focal length is read from any container, in either byte order", async () => {
  for (const before of ["\u00ff\u00d8....Exif\0\0", "....eXIf", "....EXIF\u0010\0\0\0"]) {
    for (const isLittle of [true, false]) {
      const fov = await exifFovDeg(fileOf(before, 27, isLittle));
      assert.ok(Math.abs(fov - 67.38) < 0.01, `${before}: ${fov}`);
    }
  }
});

test("what is not noted, or not to be believed, is none", async () => {
  const whole = fileOf("Exif\0\0", 27, true);
  for (const blob of [new Blob(["a photo"]), fileOf("Exif\0\0", 0, true), fileOf("Exif\0\0", 5000, false), whole.slice(0, 30)]) {
    assert.equal(await exifFovDeg(blob), null);
  }
});

test("an option goes before the file, and the file before a phone's lens", () => {
  const picture = { width: 640, height: 480, exifFovDeg: 40 };
  assert.deepEqual(lensOf({ longFovDeg: 50 }, picture), { longFovDeg: 50, source: "given" });
  assert.deepEqual(lensOf({}, picture), { longFovDeg: 40, source: "exif" });
  assert.equal(lensOf({}, { width: 640, height: 480 }).source, "default");
});
