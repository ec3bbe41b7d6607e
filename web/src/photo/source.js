/** Read any source of a picture into memory. */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError, readable } from "../errors.js";
import { exifFovDeg } from "../files/exif.js";
import { maskFromAlpha } from "./picture.js";
import { resize } from "./resize.js";
import { takeTexture, upright } from "./textures.js";

/** Longer side to which a picture is shrunk; ample for a crop of 128. */
const LONG_PX = 1600;

/**
 * Pixels of a picture, shrunk to a longer side of 1600.
 *
 * @param {import("../../types/index.d.ts").ImageSource} source
 * @returns {Promise<import("./picture.js").Picture & {scale: number, fullWidth: number, fullHeight: number, exifFovDeg?: number | null}>}
 *   scale: pixels of it for one of the source; exifFovDeg: of its longer side, where its file notes it
 */
export async function readSource(source, signal) {
  signal?.throwIfAborted();
  if (source?.rgba) return whole(checkPixels(source));
  if (source?.texture) return ofTexture(checkTexture(source));
  return inMemory(await open(source, "image", IMAGES, signal), signal);
}

async function ofTexture(source) {
  const { frame } = await takeTexture(source, LONG_PX); // begun at once
  return { ...upright(frame), scale: frame.width / source.width, fullWidth: source.width, fullHeight: source.height };
}

function inMemory(ready, signal) {
  signal?.throwIfAborted();
  const [width, height] = sizeOf(ready);
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  const about = { scale, fullWidth: width, fullHeight: height, exifFovDeg: lenses.get(ready) };
  if (scale === 1 && isImageData(ready)) return { width, height, rgba: ready.data, ...about };
  return { ...draw(ready, width, height, scale), ...about };
}

/** Read pixels in memory; small pictures stay as they are. */
function whole({ width, height, rgba }) {
  if (Math.max(width, height) > LONG_PX) return inMemory(new ImageData(new Uint8ClampedArray(rgba), width, height));
  return { width, height, rgba, scale: 1, fullWidth: width, fullHeight: height };
}

const isImageData = (source) => typeof ImageData === "function" && source instanceof ImageData;
/** Whether a value is of a class that this browser has. */
export const isOf = (source, name) => typeof globalThis[name] === "function" && source instanceof globalThis[name];

const DRAWABLE = ["HTMLImageElement", "HTMLVideoElement", "HTMLCanvasElement", "OffscreenCanvas", "ImageBitmap", "VideoFrame", "ImageData"];
const BYTES = ["Uint8ClampedArray", "Uint8Array"];
const IMAGES = `an address, a Blob or File, ${DRAWABLE.join(", ")}, { gl, texture, width, height } or { width, height, rgba }`;
const MASKS = `a Float32Array of the picture's pixels, { data, width, height } of one, what probe.mask() gives, a light's mask, a MediaPipe mask, an address, a Blob or File, ${DRAWABLE.join(", ")}`;

/** What can be drawn: fetched and decoded where it is an address or a file, waited for where it is on its way. */
async function open(source, name, expected, signal) {
  const invalid = (expected, why) => new AnyProbeError("invalid-image", `expected ${expected}, got ${why}`, { subject: [name] });
  if (source === "") throw invalid(expected, "an empty address");
  if (typeof source === "string" || isOf(source, "URL")) return decode(await fetchBlob(String(source), name, signal), name, String(source));
  if (isOf(source, "Blob")) return decode(source, name, source.name);
  if (isOf(source, "HTMLImageElement")) {
    if (!source.currentSrc && !source.src && !source.srcset) throw invalid("a picture with pixels", "an image without an address");
    await source.decode().catch(() => {
      throw invalid("a picture that the browser can show", `${source.currentSrc || source.src || "none"}, which it cannot`);
    });
  }
  if (!DRAWABLE.some((kind) => isOf(source, kind))) throw invalid(expected, kindOf(source));
  const [width, height] = sizeOf(source);
  if (isEarly(source) || !(width > 0 && height > 0)) {
    throw invalid("a picture with pixels", isOf(source, "HTMLVideoElement") ? "a video before its first frame; wait for loadeddata" : `one that is ${width} x ${height} pixels`);
  }
  return source;
}

/** Name the kind of a value. */
export const kindOf = (value) => (value === null ? "null" : typeof value === "object" ? (value.constructor?.name ?? "an object") : typeof value);

async function fetchBlob(url, name, signal) {
  try {
    const answer = await fetch(url, { signal });
    if (!answer.ok) throw new Error(`answer ${answer.status}`);
    return await answer.blob();
  } catch (error) {
    if (signal?.aborted) throw signal.reason;
    throw new AnyProbeError("fetch-failed", `${url} could not be fetched (${error.message})`, { subject: [name] });
  }
}

/** Pictures decoded here, closed once drawn: they are large and outside garbage-collected memory. */
const ours = new WeakSet();

/** Lenses stated by the files of pictures. */
const lenses = new WeakMap();

async function decode(blob, name, from) {
  try {
    const bitmap = await createImageBitmap(blob);
    ours.add(bitmap);
    lenses.set(bitmap, await exifFovDeg(blob));
    return bitmap;
  } catch {
    const got = `${blob.type || "an unknown type"} of ${blob.size} bytes${from ? ` from ${from}` : ""}`;
    throw new AnyProbeError("invalid-image", `expected a file that the browser can show, got ${got}`, { subject: [name] });
  }
}

function checkPixels({ width, height, rgba }) {
  const kind = rgba[Symbol.toStringTag] ?? kindOf(rgba);
  if (!BYTES.includes(kind)) throw new AnyProbeError("invalid-image", `expected Uint8ClampedArray (or Uint8Array), got ${kind}`, { subject: ["image"] });
  if (Number.isInteger(width) && Number.isInteger(height) && rgba.length === 4 * width * height && width * height > 0) {
    return { width, height, rgba };
  }
  throw new AnyProbeError("invalid-image", `expected 4 bytes a pixel of ${width} x ${height}, got ${rgba.length}`, { subject: ["image"] });
}

function checkTexture(source) {
  const { gl, width, height } = source;
  if (gl && [width, height].every((side) => Number.isInteger(side) && side > 0)) return source;
  throw new AnyProbeError("invalid-image", `expected { gl, texture, width, height } of a texture, got ${width} x ${height} pixels and ${gl ? "a" : "no"} gl`, { subject: ["image"] });
}

/** Width and height of a source in its own pixels; zeros while there is none yet. */
export function sizeOf(source) {
  const { width = 0, height = 0 } = isOf(source, "MediaStreamTrack") ? source.getSettings() : source;
  return [
    source.naturalWidth ?? source.videoWidth ?? source.displayWidth ?? width,
    source.naturalHeight ?? source.videoHeight ?? source.displayHeight ?? height,
  ];
}

/** Whether a video knows its size but has no picture yet. */
export const isEarly = (source) => source?.videoWidth !== undefined && source.readyState < 2;

function draw(source, fullWidth, fullHeight, scale, name = "image") {
  const [width, height] = [fullWidth, fullHeight].map((length) => Math.max(1, Math.round(length * scale)));
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.imageSmoothingQuality = "high";
  context.drawImage(isImageData(source) ? canvasOf(source) : source, 0, 0, width, height);
  if (ours.has(source)) source.close();
  return { width, height, rgba: readable(() => context.getImageData(0, 0, width, height).data, name) };
}

function canvasOf(data) {
  const canvas = new OffscreenCanvas(data.width, data.height);
  canvas.getContext("2d").putImageData(data, 0, 0);
  return canvas;
}

/** Tolerance of a mask's aspect: one pixel of rounding. */
const MOST_UNEVEN = 0.01;

/**
 * A mask of a picture from numbers of its size, or from a picture that is white on the object, or opaque there.
 *
 * @param {import("../../types/index.d.ts").EstimateOptions["mask"]} mask
 * @param {Awaited<ReturnType<typeof readSource>>} picture
 * @returns {Promise<Float32Array>} of the picture's pixels in memory
 */
export async function readMask(mask, picture, signal) {
  const { width, height } = picture;
  const isOfMediaPipe = typeof mask?.getAsFloat32Array === "function";
  const numbers = isOfMediaPipe ? mask.getAsFloat32Array() : [mask, mask?.data].find((values) => values instanceof Float32Array);
  if (numbers && numbers.length === mask.width * mask.height) {
    checkAspect(mask, picture);
    return resize(checkShares(numbers), 1, [mask.width, mask.height], [width, height]);
  }
  if (numbers) return fit(checkShares(numbers), "mask", 1, picture);
  const ready = await open(mask, "mask", MASKS, signal);
  const [fullWidth, fullHeight] = sizeOf(ready);
  checkAspect({ width: fullWidth, height: fullHeight }, picture);
  const { rgba } = isImageData(ready) ? { rgba: ready.data } : draw(ready, fullWidth, fullHeight, 1, "mask");
  const values = maskFromAlpha({ rgba }) ?? brightness(rgba);
  return resize(values, 1, [fullWidth, fullHeight], [width, height]);
}

function checkAspect(mask, { width, height }) {
  if (Math.abs((mask.width * height) / (mask.height * width) - 1) <= MOST_UNEVEN) return;
  throw new AnyProbeError("invalid-option", `expected the picture's aspect, ${width} x ${height}, got ${mask.width} x ${mask.height}`, { subject: ["mask"] });
}

/** The outer tenths of the range are flattened, as anyprobe.masks.sources does: the noise of JPEG around black and white. */
const { black: BLACK, white: WHITE } = CONTRACT.mask;

function brightness(rgba) {
  const values = new Float32Array(rgba.length / 4);
  for (let i = 0, at = 0; i < values.length; i++, at += 4) {
    const display = Math.max(rgba[at], rgba[at + 1], rgba[at + 2]) / 255; // labelling tools paint objects in a colour
    values[i] = Math.min(Math.max((display - BLACK) / (WHITE - BLACK), 0), 1);
  }
  return values;
}

/** Normals of a picture's own size or of its size in memory, three numbers a pixel. */
export function readNormals(normals, picture) {
  if (!(normals instanceof Float32Array)) throw new AnyProbeError("invalid-option", "expected a Float32Array of three numbers a pixel", { subject: ["normals"] });
  return checkNormals(fit(normals, "normals", 3, picture));
}

const { near_unit: NEAR_UNIT, unit_share: UNIT_SHARE, facing: FACING } = CONTRACT.normals;
const SHORTEST = CONTRACT.graph.shortest_normal;

/** Unit vectors that look at the camera, most of them, as anyprobe.estimate.normals_hint asks. */
function checkNormals(normals) {
  let [known, unit, facing, isPicture] = [0, 0, 0, true];
  for (let at = 0; at < normals.length; at += 3) {
    const [x, y, z] = [normals[at], normals[at + 1], normals[at + 2]];
    const length = Math.hypot(x, y, z);
    if (!(length > SHORTEST)) continue; // NaN too
    known++;
    if (Math.abs(length - 1) < NEAR_UNIT) unit++;
    if (z > 0) facing++;
    if (x < 0 || y < 0 || z < 0) isPicture = false;
  }
  const refuse = (expected, got) => new AnyProbeError("invalid-option", `expected ${expected}, got ${got}`, { subject: ["normals"] });
  if (known === 0) throw refuse("unit vectors where the object is", "none");
  if (unit < UNIT_SHARE * known && isPicture) throw refuse("unit vectors", "values of a picture, (n + 1) / 2; give 2 * value - 1, of bytes value / 127.5 - 1");
  if (facing < FACING * known) throw refuse("normals towards the camera (+X right, +Y up, +Z to it)", "most that look away; flip Y and Z if they are OpenCV's");
  return normals;
}

function checkShares(mask) {
  for (const value of mask) {
    if (!(value >= 0 && value <= 1)) throw new AnyProbeError("invalid-option", `expected numbers from 0 to 1, got ${value}`, { subject: ["mask"] });
  }
  return mask;
}

/** Numbers of the picture's original size, shrunk like it. */
function fit(values, name, channels, { width, height, fullWidth, fullHeight }) {
  if (values.length === channels * width * height) return values;
  if (values.length === channels * fullWidth * fullHeight) return resize(values, channels, [fullWidth, fullHeight], [width, height]);
  const each = channels === 1 ? "" : ` x ${channels}`;
  throw new AnyProbeError("invalid-option", `expected ${fullWidth} x ${fullHeight}${each} numbers, got ${values.length}`, { subject: [name] });
}
