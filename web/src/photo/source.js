/** Whatever holds a picture to a picture in memory. */

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
 * @param {CanvasImageSource | ImageData | CameraTexture | import("./picture.js").Picture} source
 * @returns {import("./picture.js").Picture & {scale: number}} scale: pixels of it for one of the source
 */
export function readSource(source) {
  if (source.rgba) return { ...source, scale: 1 };
  if (source.texture) return { ...readTexture(source), scale: 1 };
  const [width, height] = sizeOf(source);
  if (!(width > 0 && height > 0)) throw new Error("image: expected one with pixels, got none; wait until it is loaded");
  const scale = Math.min(1, LONG_PX / Math.max(width, height));
  if (scale === 1 && typeof ImageData === "function" && source instanceof ImageData) {
    return { width, height, rgba: source.data, scale };
  }
  return { ...draw(source, width, height, scale), scale };
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
  const isData = typeof ImageData === "function" && source instanceof ImageData;
  context.drawImage(isData ? canvasOf(source) : source, 0, 0, width, height);
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

/**
 * A mask of a picture from numbers of its size, or from a picture that is white (or opaque) on the object.
 *
 * @param {Float32Array | CanvasImageSource | ImageData} mask
 * @param {import("./picture.js").Picture} picture
 * @returns {Float32Array}
 */
export function readMask(mask, { width, height }) {
  if (mask instanceof Float32Array) {
    if (mask.length !== width * height) {
      throw new Error(`mask: expected ${width} x ${height} numbers, got ${mask.length}; pass a picture to have it scaled`);
    }
    return mask;
  }
  const [fullWidth, fullHeight] = sizeOf(mask);
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const isData = typeof ImageData === "function" && mask instanceof ImageData;
  context.drawImage(isData ? canvasOf(mask) : mask, 0, 0, fullWidth, fullHeight, 0, 0, width, height);
  const { data } = context.getImageData(0, 0, width, height);
  return Float32Array.from({ length: width * height }, (_, i) => (data[4 * i] * data[4 * i + 3]) / 65025);
}
