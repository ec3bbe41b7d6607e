/** anyprobe/exr: a radiance map as OpenEXR, by three.js's exporter. */

import { DataTexture, FloatType, RGBAFormat } from "three";
import { EXRExporter, ZIP_COMPRESSION } from "three/addons/exporters/EXRExporter.js";
import { checkMap } from "./hdr.js";

/** @param {Float32Array} radiance [height, 2 height, 3], row 0 up @returns {Promise<Uint8Array<ArrayBuffer>>} a file of 32-bit floats */
export async function encodeExr(radiance, height) {
  checkMap(radiance, height);
  const width = 2 * height;
  const data = new Float32Array(4 * width * height).fill(1);
  for (let row = 0; row < height; row++) {
    let to = 4 * width * (height - 1 - row); // a texture's first row is the lowest
    for (let from = 3 * width * row; from < 3 * width * (row + 1); from += 3, to += 4) data.set(radiance.slice(from, from + 3), to);
  }
  const texture = new DataTexture(data, width, height, RGBAFormat, FloatType);
  return new EXRExporter().parse(texture, { type: FloatType, compression: ZIP_COMPRESSION });
}
