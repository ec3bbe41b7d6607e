/** A radiance map as OpenEXR: 32-bit float, no compression, envmap=latlong, front in the centre. */

const CHROMATICITIES = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
const FLOAT = 2;

/** @returns {Uint8Array} the file of a map [height, 2 height, 3] */
export function encodeExr(radiance, height) {
  const width = 2 * height;
  const header = new Bytes();
  header.u32(20000630).u32(2);
  header.attribute("channels", "chlist", (value) => {
    for (const name of ["B", "G", "R"]) value.text(name).u32(FLOAT).u32(0).u32(1).u32(1);
    value.u8(0);
  });
  header.attribute("chromaticities", "chromaticities", (value) => CHROMATICITIES.forEach((v) => value.f32(v)));
  header.attribute("compression", "compression", (value) => value.u8(0));
  for (const name of ["dataWindow", "displayWindow"]) {
    header.attribute(name, "box2i", (value) => value.u32(0).u32(0).u32(width - 1).u32(height - 1));
  }
  header.attribute("envmap", "envmap", (value) => value.u8(0));
  header.attribute("lineOrder", "lineOrder", (value) => value.u8(0));
  header.attribute("pixelAspectRatio", "float", (value) => value.f32(1));
  header.attribute("screenWindowCenter", "v2f", (value) => value.f32(0).f32(0));
  header.attribute("screenWindowWidth", "float", (value) => value.f32(1));
  header.u8(0);

  const lineBytes = 8 + 3 * 4 * width;
  const start = header.length + 8 * height;
  const file = new DataView(new ArrayBuffer(start + lineBytes * height));
  header.copyTo(file);
  for (let row = 0; row < height; row++) {
    const line = start + row * lineBytes;
    file.setBigUint64(header.length + 8 * row, BigInt(line), true);
    file.setInt32(line, row, true);
    file.setInt32(line + 4, lineBytes - 8, true);
    [2, 1, 0].forEach((channel, place) => {
      for (let x = 0; x < width; x++) {
        file.setFloat32(line + 8 + 4 * (place * width + x), radiance[3 * (row * width + x) + channel], true);
      }
    });
  }
  return new Uint8Array(file.buffer);
}

/** Little-endian bytes that grow. */
class Bytes {
  #bytes = [];

  get length() {
    return this.#bytes.length;
  }

  u8(value) {
    this.#bytes.push(value & 255);
    return this;
  }

  u32(value) {
    for (let shift = 0; shift < 32; shift += 8) this.u8(value >>> shift);
    return this;
  }

  f32(value) {
    this.#bytes.push(...new Uint8Array(Float32Array.of(value).buffer));
    return this;
  }

  /** ASCII and a zero. */
  text(value) {
    for (const letter of value) this.u8(letter.charCodeAt(0));
    return this.u8(0);
  }

  attribute(name, type, write) {
    const value = new Bytes();
    write(value);
    this.text(name).text(type).u32(value.length);
    this.#bytes.push(...value.#bytes);
  }

  copyTo(view) {
    this.#bytes.forEach((value, at) => view.setUint8(at, value));
  }
}
