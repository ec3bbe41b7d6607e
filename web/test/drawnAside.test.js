/** What WebGL drew beside the page comes to the canvas that is shown: upright, colours apart from coverage. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { showDrawn, straight } from "../page/view/drawnAside.js";

const [LOW, HIGH] = [[10, 20, 30, 255], [200, 100, 50, 255]];

test("colours are told without their coverage, shadows and clear pixels stay black", () => {
  const drawn = Uint8ClampedArray.from([60, 30, 0, 120, 0, 0, 0, 90, 0, 0, 0, 0]);
  assert.deepEqual([...straight(drawn)], [128, 64, 0, 120, 0, 0, 0, 90, 0, 0, 0, 0]);
});

/** A WebGL that is done after so many looks, and what was asked of it. */
function slowGl(looks, pixels) {
  const asked = [];
  const gl = new Proxy(
    {
      drawingBufferWidth: 1,
      drawingBufferHeight: 2,
      isContextLost: () => false,
      fenceSync: () => ({}),
      clientWaitSync: () => (looks-- > 0 ? "TIMEOUT_EXPIRED" : "CONDITION_SATISFIED"),
      getBufferSubData: (_, __, drawn) => {
        asked.push("getBufferSubData");
        drawn.set(pixels);
      },
    },
    { get: (own, name) => own[name] ?? (/^[A-Z]/.test(name) ? name : () => asked.push(name)) },
  );
  return { gl, asked };
}

test("nothing is fetched before it is drawn; then the canvas has its size and pixels", async () => {
  globalThis.ImageData = class {
    constructor(data, width, height) {
      Object.assign(this, { data, width, height });
    }
  };
  const shown = [];
  const canvas = { width: 300, height: 150 };
  canvas.getContext = () => ({ canvas, putImageData: (image) => shown.push(image) });
  const { gl, asked } = slowGl(2, [...LOW, ...HIGH]);
  const showing = showDrawn(gl, canvas);
  await null;
  assert.ok(asked.includes("readPixels") && !asked.includes("getBufferSubData"));
  await showing;
  assert.deepEqual([canvas.width, canvas.height], [1, 2]);
  assert.deepEqual([...shown[0].data], [...HIGH, ...LOW]);
});
