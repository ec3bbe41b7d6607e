/**
 * The pixels of a texture, such as XRWebGLBinding.getCameraImage gives, without waiting for the GPU: it copies them, shrunk,
 * into a buffer of its own, and they are read when it says that it has.
 */

import { AnyProbeError } from "../errors.js";

/** Time between two checks of the copy. */
const POLL_MS = 2;

/**
 * Begin at once, as a camera's texture holds its picture during one callback alone.
 *
 * @param {import("../../types/index.d.ts").CameraTexture} source
 * @param {number} longPx longer side of the copy
 * @param {ArrayBuffer[]} [spares] memory of earlier copies
 * @returns {Promise<{frame: object, transfer: object[]}>} frame is {width, height, format, bytes}, its first row the lowest
 */
export async function takeTexture({ gl, texture, width: fullWidth, height: fullHeight }, longPx, spares = []) {
  const scale = Math.min(1, longPx / Math.max(fullWidth, fullHeight));
  const [width, height] = [fullWidth, fullHeight].map((length) => Math.max(1, Math.round(length * scale)));
  const bytes = await readShrunk(gl, texture, [fullWidth, fullHeight], [width, height], spares);
  return { frame: { width, height, format: "RGBA", bytes }, transfer: [bytes.buffer] };
}

/**
 * RGBA of what is bound for reading, its lowest row first; begun at once.
 *
 * @param {WebGL2RenderingContext} gl
 * @param {ArrayBuffer[]} [spares] as of takeTexture
 * @returns {Promise<Uint8Array>}
 */
export async function readBack(gl, width, height, spares = []) {
  const size = 4 * width * height;
  const copy = gl.createBuffer();
  let restore = packPlainly(gl, copy);
  gl.bufferData(gl.PIXEL_PACK_BUFFER, size, gl.STREAM_READ);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
  restore();
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  try {
    await isDone(gl, fence);
    const spare = spares.pop();
    const bytes = new Uint8Array(spare?.byteLength === size ? spare : size);
    restore = packPlainly(gl, copy);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, bytes);
    restore();
    return bytes;
  } finally {
    gl.deleteSync(fence);
    gl.deleteBuffer(copy);
  }
}

/** A copy's pixels, the highest row first. */
export function upright({ width, height, bytes }) {
  const line = 4 * width;
  const rgba = new Uint8ClampedArray(bytes.length);
  for (let row = 0; row < height; row++) rgba.set(bytes.subarray((height - 1 - row) * line, (height - row) * line), row * line);
  return { width, height, rgba };
}

/** A texture's pixels; restores all bindings of the context. */
function readShrunk(gl, texture, [fullWidth, fullHeight], [width, height], spares) {
  const before = {
    read: gl.getParameter(gl.READ_FRAMEBUFFER_BINDING),
    draw: gl.getParameter(gl.DRAW_FRAMEBUFFER_BINDING),
    store: gl.getParameter(gl.RENDERBUFFER_BINDING),
    cuts: gl.isEnabled(gl.SCISSOR_TEST),
  };
  const [from, to] = [gl.createFramebuffer(), gl.createFramebuffer()];
  const store = gl.createRenderbuffer();
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
  gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const isComplete = gl.checkFramebufferStatus(gl.READ_FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
  gl.bindRenderbuffer(gl.RENDERBUFFER, store);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
  gl.framebufferRenderbuffer(gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, store);
  gl.disable(gl.SCISSOR_TEST);
  gl.blitFramebuffer(0, 0, fullWidth, fullHeight, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.LINEAR);
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, to);
  const reading = isComplete ? readBack(gl, width, height, spares) : null;
  if (before.cuts) gl.enable(gl.SCISSOR_TEST);
  gl.bindRenderbuffer(gl.RENDERBUFFER, before.store);
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, before.read);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, before.draw);
  gl.deleteFramebuffer(from);
  gl.deleteFramebuffer(to);
  gl.deleteRenderbuffer(store);
  if (reading) return reading;
  throw new AnyProbeError("invalid-image", "expected a texture with pixels of a colour, got one that cannot be read", { subject: ["image"] });
}

async function isDone(gl, fence) {
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    if (gl.isContextLost()) throw new AnyProbeError("failed", "The WebGL context of the camera's texture was lost.");
    const state = gl.clientWaitSync(fence, 0, 0);
    if (state === gl.ALREADY_SIGNALED || state === gl.CONDITION_SATISFIED) return;
    if (state === gl.WAIT_FAILED) throw new AnyProbeError("failed", "The camera's texture could not be read.");
  }
}

/** Pixels are packed without gaps into a buffer from here until what is returned is called. */
function packPlainly(gl, buffer) {
  const plain = { PACK_ALIGNMENT: 4, PACK_ROW_LENGTH: 0, PACK_SKIP_PIXELS: 0, PACK_SKIP_ROWS: 0 };
  const [bound, was] = [gl.getParameter(gl.PIXEL_PACK_BUFFER_BINDING), Object.keys(plain).map((name) => gl.getParameter(gl[name]))];
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
  for (const [name, value] of Object.entries(plain)) gl.pixelStorei(gl[name], value);
  return () => {
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, bound);
    Object.keys(plain).forEach((name, i) => gl.pixelStorei(gl[name], was[i]));
  };
}
