/** The camera's frames: taken in the page as small bitmaps, read in the networks' thread. */

import { takeTexture, upright } from "../photo/textures.js";
import { sizeOf } from "../photo/source.js";

/** Longer side of the frames that are processed. */
const LONG_PX = 480;

/**
 * The source's present frame.
 *
 * @param {import("../../types/index.d.ts").FrameSource} given a playing video, a VideoFrame, a picture, or a texture
 * @param {ArrayBuffer[]} [spares] memory of earlier textures, used again where its size is right
 * @returns {Promise<{frame: object, transfer: object[]}>} frame is an ImageBitmap, or {width, height, bytes}; transfer is what of
 *   it moves to another thread
 */
export async function takeFrame(given, spares = []) {
  if (given.texture) return takeTexture(given, LONG_PX, spares);
  const [resizeWidth, resizeHeight] = readSize(...sizeOf(given));
  const frame = await createImageBitmap(given, { resizeWidth, resizeHeight, resizeQuality: "medium" });
  return { frame, transfer: [frame] };
}

/** Width and height at which a frame is looked at. */
export function readSize(width, height) {
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  return [width, height].map((length) => Math.max(1, Math.round(length * scale)));
}

let context = null;

/** A frame as a picture of at most LONG_PX. @param {object} frame of takeFrame @returns {import("../photo/picture.js").Picture} */
export function readFrame(frame) {
  if (frame.bytes) return upright(frame);
  const { width, height } = frame;
  context ??= new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  const { canvas } = context;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.clearRect(0, 0, width, height);
  context.drawImage(frame, 0, 0);
  frame.close();
  return { width, height, rgba: context.getImageData(0, 0, width, height).data };
}
