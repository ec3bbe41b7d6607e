/**
 * What WebGL drew, put on a plain canvas once it is done.
 *
 * Where the page is composed in software, a canvas of WebGL is read back for it, and the page's thread stands still until all is
 * drawn: no picture of the camera is heard meanwhile. So it is drawn on a canvas that is not shown, and read when it is done.
 */

import { readBack, upright } from "../../src/photo/textures.js";

/**
 * Show what was drawn last; right after it was drawn.
 *
 * @param {WebGL2RenderingContext} gl
 * @param {HTMLCanvasElement} canvas that is shown
 */
export async function showDrawn(gl, canvas) {
  const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
  const { rgba } = upright({ width, height, bytes: await readBack(gl, width, height) });
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  canvas.getContext("2d").putImageData(new ImageData(straight(rgba), width, height), 0, 0);
}

/** Colours times coverage, as WebGL has them, as a canvas takes them; in place. @param {Uint8ClampedArray} rgba */
export function straight(rgba) {
  for (let at = 0; at < rgba.length; at += 4) {
    const alpha = rgba[at + 3];
    if (alpha > 0 && alpha < 255) for (let c = at; c < at + 3; c++) rgba[c] = (255 * rgba[c]) / alpha;
  }
  return rgba;
}
