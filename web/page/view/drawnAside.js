/**
 * What WebGL drew, put on a plain canvas once it is done.
 *
 * Where the page is composed in software, a canvas of WebGL is read back for it, and the page's thread
 * stands still until all is drawn: no picture of the camera is heard meanwhile. So it is drawn on a canvas
 * that is not shown, copied into a buffer behind the drawing, and asked for when the copy is there.
 */

/** Between two looks at whether it is. */
const LOOK_MS = 4;

export class DrawnAside {
  #pixels = null;
  #size = 0;

  /**
   * @param {WebGL2RenderingContext} gl
   * @param {HTMLCanvasElement} canvas that is shown
   */
  constructor(gl, canvas) {
    this.gl = gl;
    this.context = canvas.getContext("2d");
  }

  /** Show what was drawn last; right after it was drawn. One at a time. */
  async show() {
    const { gl } = this;
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const size = 4 * width * height;
    this.#pixels ??= gl.createBuffer();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#pixels);
    if (this.#size !== size) gl.bufferData(gl.PIXEL_PACK_BUFFER, size, gl.STREAM_READ);
    this.#size = size;
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    await this.#done();
    const drawn = new Uint8Array(size);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#pixels);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, drawn);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.#put(upright(drawn, width, height), width, height);
  }

  /** Until all that was asked of WebGL so far is done, or its context is lost. */
  async #done() {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    while (fence && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) {
      await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
    }
    gl.deleteSync(fence);
  }

  #put(rgba, width, height) {
    const { canvas } = this.context;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.context.putImageData(new ImageData(rgba, width, height), 0, 0);
  }
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
