/**
 * What WebGL drew, put on a plain canvas once it is done.
 *
 * Where the page is composed in software, a canvas of WebGL is read back for it, and the page's thread stands still until all is
 * drawn: no picture of the camera is heard meanwhile. So it is drawn on a canvas that is not shown, and read when it is done.
 */

import { readBack } from "../../src/photo/textures.js";

/**
 * Show what was drawn last; right after it was drawn.
 *
 * @param {WebGL2RenderingContext} gl
 * @param {HTMLCanvasElement} canvas that is shown
 */
export async function showDrawn(gl, canvas) {
  const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
  const rgba = upright(await readBack(gl, width, height), width, height);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  canvas.getContext("2d").putImageData(new ImageData(rgba, width, height), 0, 0);
}

/**
 * Pixels as WebGL has them, the lowest row first and colours times coverage, as a canvas takes them.
 *
 * @param {Uint8Array} drawn RGBA, width * height * 4
 * @returns {Uint8ClampedArray}
 */
export function upright(drawn, width, height) {
  const rgba = new Uint8ClampedArray(drawn.length);
  const from = new Uint32Array(drawn.buffer, drawn.byteOffset, width * height);
  const to = new Uint32Array(rgba.buffer);
  for (let y = 0; y < height; y++) {
    const row = (height - 1 - y) * width;
    for (let x = 0, at = y * width; x < width; x++, at++) {
      if (from[row + x] === 0) continue;
      const alpha = drawn[4 * (row + x) + 3];
      if (alpha === 255 || alpha === 0) to[at] = from[row + x];
      else {
        for (let c = 0; c < 3; c++) rgba[4 * at + c] = (255 * drawn[4 * (row + x) + c]) / alpha;
        rgba[4 * at + 3] = alpha;
      }
    }
  }
  return rgba;
}
