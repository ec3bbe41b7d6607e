/** Whatever holds a picture to a picture in memory. */

import { CONTRACT } from "../core/contract.js";
import { luminance } from "../core/color.js";
import { AnyProbeError } from "../errors.js";
import { maskFromAlpha } from "./picture.js";
import { resize } from "./resize.js";

/** Longer side at which a picture is kept: plenty for a crop of 128. */
const LONG_PX = 1600;

/**
 * @typedef {object} CameraTexture a texture of WebGL, such as XRWebGLBinding.getCameraImage gives of an XRFrame's view
 * @property {WebGL2RenderingContext} gl
 * @property {WebGLTexture} texture
 * @property {number} width
 * @property {number} height
 */

/**
 * Pixels of a picture, shrunk to a longer side of 1600.
 *
 * @param {import("../../types/index.d.ts").ImageSource} source
 * @param {AbortSignal} [signal]
 * @returns {Promise<import("./picture.js").Picture & {scale: number, fullWidth: number, fullHeight: number}>} scale: pixels of
 *   it for one of the source
 */
export async function readSource(source, signal) {
  signal?.throwIfAborted();
  if (source?.rgba) return whole(checkPixels(source));
  if (source?.texture) return whole(readTexture(checkTexture(source)));
  const ready = await open(source, "image", signal);
  signal?.throwIfAborted();
  const [width, height] = sizeOf(ready);
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  const about = { scale, fullWidth: width, fullHeight: height };
  if (scale === 1 && isImageData(ready)) return { width, height, rgba: ready.data, ...about };
  return { ...draw(ready, width, height, scale), ...about };
}

const whole = (picture) => ({ ...picture, scale: 1, fullWidth: picture.width, fullHeight: picture.height });
const isImageData = (source) => typeof ImageData === "function" && source instanceof ImageData;
const isOf = (source, name) => typeof globalThis[name] === "function" && source instanceof globalThis[name];

/** What can be drawn: fetched and decoded where it is an address or a file, waited for where it is on its way. */
async function open(source, name, signal) {
  const invalid = (expected, why) => new AnyProbeError("invalid-image", `${name}: expected ${expected}, got ${why}`);
  if (typeof source === "string" || isOf(source, "URL")) return decode(await fetchBlob(String(source), name, signal), name);
  if (isOf(source, "Blob")) return decode(source, name);
  if (isOf(source, "HTMLImageElement")) {
    if (!source.currentSrc && !source.src && !source.srcset) throw invalid("a picture with pixels", "an image without an address");
    await source.decode().catch(() => {
      throw invalid("a picture that the browser can show", `${source.currentSrc || source.src || "none"}, which it cannot`);
    });
  }
  const drawable = ["HTMLImageElement", "HTMLVideoElement", "HTMLCanvasElement", "OffscreenCanvas", "ImageBitmap", "VideoFrame", "ImageData"];
  if (!drawable.some((kind) => isOf(source, kind))) {
    throw invalid(`an address, a Blob or File, ${drawable.join(", ")}, { gl, texture, width, height } or { width, height, rgba }`, kindOf(source));
  }
  const [width, height] = sizeOf(source);
  if (!(width > 0 && height > 0)) {
    throw invalid("one with pixels", isOf(source, "HTMLVideoElement") ? "a video before its first frame; wait for loadeddata" : "none");
  }
  return source;
}

/** What something is, in a word. */
export const kindOf = (value) => (value === null ? "null" : typeof value === "object" ? (value.constructor?.name ?? "an object") : typeof value);

async function fetchBlob(url, name, signal) {
  try {
    const answer = await fetch(url, { signal });
    if (!answer.ok) throw new Error(`answer ${answer.status}`);
    return await answer.blob();
  } catch (error) {
    if (signal?.aborted) throw signal.reason;
    throw new AnyProbeError("fetch-failed", `${name}: ${url} could not be fetched (${error.message})`);
  }
}

async function decode(blob, name) {
  try {
    return await createImageBitmap(blob);
  } catch {
    throw new AnyProbeError("invalid-image", `${name}: expected a file that the browser can show, got ${blob.type || "an unknown type"} of ${blob.size} bytes`);
  }
}

function checkPixels({ width, height, rgba }) {
  if (Number.isInteger(width) && Number.isInteger(height) && rgba.length === 4 * width * height && width * height > 0) {
    return { width, height, rgba };
  }
  throw new AnyProbeError("invalid-image", `image: expected 4 bytes a pixel of ${width} x ${height}, got ${rgba.length}`);
}

function checkTexture(source) {
  const { gl, width, height } = source;
  if (gl && [width, height].every((side) => Number.isInteger(side) && side > 0)) return source;
  throw new AnyProbeError("invalid-image", `image: expected { gl, texture, width, height } of a texture, got ${width} x ${height} pixels and ${gl ? "a" : "no"} gl`);
}

function sizeOf(source) {
  return [
    source.naturalWidth ?? source.videoWidth ?? source.displayWidth ?? source.width,
    source.naturalHeight ?? source.videoHeight ?? source.displayHeight ?? source.height,
  ];
}

function draw(source, fullWidth, fullHeight, scale) {
  const [width, height] = [fullWidth, fullHeight].map((length) => Math.max(1, Math.round(length * scale)));
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.imageSmoothingQuality = "high";
  context.drawImage(isImageData(source) ? canvasOf(source) : source, 0, 0, width, height);
  return { width, height, rgba: context.getImageData(0, 0, width, height).data };
}

function canvasOf(data) {
  const canvas = new OffscreenCanvas(data.width, data.height);
  canvas.getContext("2d").putImageData(data, 0, 0);
  return canvas;
}

/** The pixels of a texture, whose first row is the lowest. */
function readTexture({ gl, texture, width, height }) {
  const before = gl.getParameter(gl.READ_FRAMEBUFFER_BINDING);
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const pixels = new Uint8ClampedArray(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, before);
  gl.deleteFramebuffer(framebuffer);
  const rgba = new Uint8ClampedArray(pixels.length);
  for (let row = 0; row < height; row++) {
    rgba.set(pixels.subarray(4 * (height - 1 - row) * width, 4 * (height - row) * width), 4 * row * width);
  }
  return { width, height, rgba };
}

/** By how much a mask's aspect may be another than its picture's: a pixel of rounding. */
const MOST_UNEVEN = 0.01;

/**
 * A mask of a picture from numbers of its size, or from a picture that is white on the object, or opaque there.
 *
 * @param {Float32Array | import("../../types/index.d.ts").ImageSource} mask
 * @param {Awaited<ReturnType<typeof readSource>>} picture
 * @param {AbortSignal} [signal]
 * @returns {Promise<Float32Array>} of the picture's pixels in memory
 */
export async function readMask(mask, picture, signal) {
  const { width, height } = picture;
  if (mask instanceof Float32Array) return fit(checkShares(mask), "mask", 1, picture);
  const ready = await open(mask, "mask", signal);
  const [fullWidth, fullHeight] = sizeOf(ready);
  if (Math.abs((fullWidth * height) / (fullHeight * width) - 1) > MOST_UNEVEN) {
    throw new AnyProbeError("invalid-option", `mask: expected the picture's aspect, ${width} x ${height}, got ${fullWidth} x ${fullHeight}`);
  }
  const { rgba } = isImageData(ready) ? { rgba: ready.data } : draw(ready, fullWidth, fullHeight, 1);
  const values = maskFromAlpha({ rgba }) ?? brightness(rgba);
  return resize(values, 1, [fullWidth, fullHeight], [width, height]);
}

/** The outer tenths of the range are flattened, as anyprobe.masks.sources does: the noise of JPEG around black and white. */
const { black: BLACK, white: WHITE } = CONTRACT.mask.file;

function brightness(rgba) {
  const values = new Float32Array(rgba.length / 4);
  for (let i = 0, at = 0; i < values.length; i++, at += 4) {
    const display = luminance(rgba[at], rgba[at + 1], rgba[at + 2]) / 255;
    values[i] = Math.min(Math.max((display - BLACK) / (WHITE - BLACK), 0), 1);
  }
  return values;
}

/** Normals of a picture's own size or of its size in memory, three numbers a pixel. */
export function readNormals(normals, picture) {
  if (!(normals instanceof Float32Array)) throw new AnyProbeError("invalid-option", "normals: expected a Float32Array of three numbers a pixel");
  return fit(normals, "normals", 3, picture);
}

function checkShares(mask) {
  for (const value of mask) {
    if (!(value >= 0 && value <= 1)) throw new AnyProbeError("invalid-option", `mask: expected numbers from 0 to 1, got ${value}`);
  }
  return mask;
}

/** Numbers of the picture's own size, shrunk as it was. */
function fit(values, name, channels, { width, height, fullWidth, fullHeight }) {
  if (values.length === channels * width * height) return values;
  if (values.length === channels * fullWidth * fullHeight) return resize(values, channels, [fullWidth, fullHeight], [width, height]);
  const each = channels === 1 ? "" : ` x ${channels}`;
  throw new AnyProbeError("invalid-option", `${name}: expected ${fullWidth} x ${fullHeight}${each} numbers, got ${values.length}`);
}
