/**
 * The pixels of a texture, such as XRWebGLBinding.getCameraImage gives, without waiting for the GPU: it copies them, shrunk,
 * into a buffer of its own, and they are read when it says that it has.
 */

import { AnyProbeError } from "../errors.js";
import { packPlainly } from "../photo/source.js";

/** Between two looks whether the copy is done. */
const POLL_MS = 2;

/**
 * Begin at once, as a camera's texture holds its picture during one callback alone.
 *
 * @param {import("../photo/source.js").CameraTexture} source
 * @param {number} longPx longer side of the copy
 * @param {ArrayBuffer[]} spares
 * @returns {Promise<{frame: object, transfer: object[]}>} frame is {width, height, format, bytes}, its first row the lowest
 */
export async function takeTexture({ gl, texture, width: fullWidth, height: fullHeight }, longPx, spares) {
  const scale = Math.min(1, longPx / Math.max(fullWidth, fullHeight));
  const [width, height] = [fullWidth, fullHeight].map((length) => Math.max(1, Math.round(length * scale)));
  const size = 4 * width * height;
  const copy = gl.createBuffer();
  const fence = startCopy(gl, texture, [fullWidth, fullHeight], [width, height], copy);
  try {
    await isDone(gl, fence);
    const spare = spares.pop();
    const bytes = new Uint8Array(spare?.byteLength === size ? spare : size);
    const restore = packPlainly(gl, copy);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, bytes);
    restore();
    return { frame: { width, height, format: "RGBA", bytes }, transfer: [bytes.buffer] };
  } finally {
    gl.deleteSync(fence);
    gl.deleteBuffer(copy);
  }
}

/** Everything of the context that it binds is bound again as it was. */
function startCopy(gl, texture, [fullWidth, fullHeight], [width, height], copy) {
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
  gl.bindRenderbuffer(gl.RENDERBUFFER, store);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
  gl.framebufferRenderbuffer(gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, store);
  gl.disable(gl.SCISSOR_TEST);
  gl.blitFramebuffer(0, 0, fullWidth, fullHeight, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.LINEAR);
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, to);
  const restore = packPlainly(gl, copy);
  gl.bufferData(gl.PIXEL_PACK_BUFFER, 4 * width * height, gl.STREAM_READ);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  if (before.cuts) gl.enable(gl.SCISSOR_TEST);
  restore();
  gl.bindRenderbuffer(gl.RENDERBUFFER, before.store);
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, before.read);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, before.draw);
  gl.deleteFramebuffer(from);
  gl.deleteFramebuffer(to);
  gl.deleteRenderbuffer(store);
  return fence;
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
