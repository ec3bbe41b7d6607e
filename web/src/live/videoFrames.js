/**
 * The camera's frames: taken in the page, read as small pictures in the networks' thread.
 *
 * A camera's frame is luma and chroma in memory. Its bytes are copied in the page's own thread and
 * handed over: to copy them in another, or to draw the frame on a canvas and read that back, waits for
 * the GPU's thread and all that it is drawing.
 */

import { readable } from "../errors.js";
import { takeTexture, upright } from "../photo/textures.js";

/** Longer side of the frames that are processed. */
const LONG_PX = 480;

/** Colours assumed of a frame that states none, as browsers do. */
const UNSTATED = { matrix: "smpte170m", fullRange: false };

/** Kr and Kb of the luma, by the name of the matrix. */
const LUMA = { bt709: [0.2126, 0.0722], smpte170m: [0.299, 0.114], bt470bg: [0.299, 0.114] };

/**
 * The source's present frame.
 *
 * @param {import("../../types/index.d.ts").FrameSource} given a playing video, a VideoFrame, a picture, or a texture
 * @param {ArrayBuffer[]} [spares] memory of earlier frames, used again where its size is right
 * @returns {Promise<{frame: object, transfer: object[]}>} frame is an ImageBitmap, or {width, height, format, layout,
 *   matrix, fullRange, bytes}; transfer is what of it moves to another thread
 */
export async function takeFrame(given, spares = []) {
  if (given.texture) return takeTexture(given, LONG_PX, spares);
  const source = typeof VideoFrame === "function" && isMoving(given) ? readable(() => new VideoFrame(given), "frame") : null;
  try {
    if (source && isReadable(source)) {
      const { width, height } = source.visibleRect;
      const { format, colorSpace } = source;
      const size = source.allocationSize();
      const spare = spares.pop();
      const bytes = new Uint8Array(spare?.byteLength === size ? spare : size);
      const layout = await source.copyTo(bytes);
      const matrix = colorSpace.matrix ?? UNSTATED.matrix;
      const fullRange = colorSpace.fullRange ?? UNSTATED.fullRange;
      return { frame: { width, height, format, layout, matrix, fullRange, bytes }, transfer: [bytes.buffer] };
    }
  } finally {
    source?.close();
  }
  const frame = await createImageBitmap(given);
  return { frame, transfer: [frame] };
}

/** Canvases and pictures have no luma and chroma planes. */
function isMoving(source) {
  return !["HTMLCanvasElement", "OffscreenCanvas", "ImageBitmap", "ImageData", "HTMLImageElement"].some(
    (name) => typeof globalThis[name] === "function" && source instanceof globalThis[name],
  );
}

/** Upright frames of square pixels, eight bits, chroma at half the resolution, in a known matrix. */
function isReadable({ format, rotation, flip, visibleRect, displayWidth, displayHeight, colorSpace }) {
  return (
    (format === "NV12" || format === "I420") &&
    !rotation &&
    !flip &&
    visibleRect.width === displayWidth &&
    visibleRect.height === displayHeight &&
    (colorSpace.matrix ?? UNSTATED.matrix) in LUMA
  );
}

/** Width and height at which a frame is looked at. */
export function readSize(width, height) {
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  return [width, height].map((length) => Math.max(1, Math.round(length * scale)));
}

/**
 * A frame as a picture of at most LONG_PX.
 *
 * @param {object} frame of takeFrame
 * @returns {import("../photo/picture.js").Picture}
 */
export function readFrame(frame) {
  const size = readSize(frame.width, frame.height);
  if (!frame.bytes) return draw(frame, size);
  return frame.format === "RGBA" ? upright(frame) : convert(frame, size);
}

/** Luma averaged over the pixels that fall into one, chroma from their middle. */
function convert({ width: fullWidth, height: fullHeight, format, layout, matrix, fullRange, bytes }, [width, height]) {
  const isWoven = format === "NV12"; // blue and red differences in turns
  const [luma, u, second] = layout;
  const v = isWoven ? { ...u, offset: u.offset + 1 } : second;
  const apart = isWoven ? 2 : 1;
  const [kr, kb] = LUMA[matrix];
  const [black, gain, chromaGain] = fullRange ? [0, 1, 1] : [16, 255 / 219, 255 / 224];
  const toRed = 2 * (1 - kr) * chromaGain;
  const toBlue = 2 * (1 - kb) * chromaGain;
  const [greenOfLight, greenOfRed, greenOfBlue] = [1, kr, kb].map((share) => share / (1 - kr - kb));
  const columns = edges(fullWidth, width);
  const rows = edges(fullHeight, height);
  const rgba = new Uint8ClampedArray(4 * width * height);
  const sums = new Float64Array(fullWidth); // of the luma of the rows that fall into one
  for (let y = 0, to = 0; y < height; y++) {
    const [top, bottom] = [rows[y], rows[y + 1]];
    sums.fill(0);
    for (let row = top; row < bottom; row++) {
      for (let column = 0, at = luma.offset + row * luma.stride; column < fullWidth; column++, at++) {
        sums[column] += bytes[at];
      }
    }
    const toBlueRow = u.offset + ((top + bottom) >> 2) * u.stride;
    const toRedRow = v.offset + ((top + bottom) >> 2) * v.stride;
    for (let x = 0; x < width; x++, to += 4) {
      const left = columns[x];
      const right = columns[x + 1];
      let sum = sums[left];
      for (let column = left + 1; column < right; column++) sum += sums[column];
      const middle = ((left + right) >> 2) * apart;
      const light = (sum / ((bottom - top) * (right - left)) - black) * gain;
      const red = light + toRed * (bytes[toRedRow + middle] - 128);
      const blue = light + toBlue * (bytes[toBlueRow + middle] - 128);
      rgba[to] = red;
      rgba[to + 1] = greenOfLight * light - greenOfRed * red - greenOfBlue * blue;
      rgba[to + 2] = blue;
      rgba[to + 3] = 255;
    }
  }
  return { width, height, rgba };
}

/** Beginning and end of each sample of a shorter line in the longer one. */
function edges(length, count) {
  return Int32Array.from({ length: count + 1 }, (_, i) => Math.floor((i * length) / count));
}

let context = null;

function draw(bitmap, [width, height]) {
  context ??= new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  const { canvas } = context;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.clearRect(0, 0, width, height);
  context.drawImage(bitmap, 0, 0, width, height);
  bitmap.close();
  return { width, height, rgba: context.getImageData(0, 0, width, height).data };
}
