/** A camera's luma and chroma to display colours, by the numbers of ITU-R BT.601 and BT.709. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { readFrame, takeFrame } from "../src/live/videoFrames.js";

/** A frame of one colour (Y, U, V), as either layout of memory. */
function frameOf([y, u, v], format, matrix, fullRange = false, [width, height] = [8, 4]) {
  const count = width * height;
  const bytes = new Uint8Array(1.5 * count).fill(y, 0, count);
  const layout = [{ offset: 0, stride: width }];
  if (format === "NV12") {
    layout.push({ offset: count, stride: width });
    for (let i = count; i < bytes.length; i += 2) bytes.set([u, v], i);
  } else {
    layout.push({ offset: count, stride: width / 2 }, { offset: 1.25 * count, stride: width / 2 });
    bytes.fill(u, count, 1.25 * count).fill(v, 1.25 * count);
  }
  return { width, height, format, layout, matrix, fullRange, bytes };
}

const RED = { bt709: [63, 102, 240], smpte170m: [81, 90, 240] };
const BLUE = { bt709: [32, 240, 118], smpte170m: [41, 240, 110] };

for (const format of ["I420", "NV12"]) {
  test(`red and blue of ${format} are changed, or their matrix is`, () => {
    for (const matrix of Object.keys(RED)) {
      for (const [told, wanted] of [[RED[matrix], [255, 0, 0]], [BLUE[matrix], [0, 0, 255]]]) {
        const { rgba } = readFrame(frameOf(told, format, matrix));
        for (let c = 0; c < 3; c++) assert.ok(Math.abs(rgba[c] - wanted[c]) <= 3, `${matrix}: ${rgba.slice(0, 3)}`);
        assert.equal(rgba[3], 255);
      }
    }
  });
}

test("a full range is read as a narrow one", () => {
  const { rgba } = readFrame(frameOf([200, 128, 128], "I420", "bt709", true));
  assert.deepEqual([...rgba.slice(0, 4)], [200, 200, 200, 255]);
});

test("a large frame is not averaged, or mirrored", () => {
  const frame = frameOf([16, 128, 128], "NV12", "bt709", true, [960, 4]);
  for (let i = 1; i < 960 * 4; i += 2) frame.bytes[i] = 216; // every second column
  frame.bytes.fill(255, 0, 2);
  frame.bytes.fill(255, 960, 962);
  const { width, height, rgba } = readFrame(frame);
  assert.deepEqual([width, height], [480, 2]);
  assert.equal(rgba[0], 255);
  assert.equal(rgba[4 * 479], 116);
});

test("a frame that does not say its colours is drawn, or taken for another matrix", async () => {
  const told = frameOf(RED.smpte170m, "I420", null);
  globalThis.VideoFrame = class {
    format = "I420";
    colorSpace = { matrix: null, fullRange: null };
    visibleRect = { width: told.width, height: told.height };
    displayWidth = told.width;
    displayHeight = told.height;
    allocationSize = () => told.bytes.length;
    copyTo = async (bytes) => (bytes.set(told.bytes), told.layout);
    close() {}
  };
  try {
    const { rgba } = readFrame((await takeFrame({})).frame);
    assert.ok(rgba[0] > 250 && rgba[1] < 5 && rgba[2] < 5, `${rgba.slice(0, 3)}`);
  } finally {
    delete globalThis.VideoFrame;
  }
});
