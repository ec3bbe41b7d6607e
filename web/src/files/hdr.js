/** A radiance map as Radiance RGBE, new run-length coding (without runs), front in the centre. */

/** @returns {Uint8Array} the file of a map [height, 2 height, 3] */
export function encodeHdr(radiance, height) {
  const width = 2 * height;
  const header = `#?RADIANCE\nSOFTWARE=anyprobe\nFORMAT=32-bit_rle_rgbe\n\n-Y ${height} +X ${width}\n`;
  const bytes = [...new TextEncoder().encode(header)];
  for (let row = 0; row < height; row++) {
    const line = Array.from({ length: width }, (_, x) => rgbe(radiance, 3 * (row * width + x)));
    bytes.push(2, 2, width >> 8, width & 255);
    for (let channel = 0; channel < 4; channel++) {
      for (let x = 0; x < width; x += 128) {
        const literal = line.slice(x, x + 128).map((pixel) => pixel[channel]);
        bytes.push(literal.length, ...literal);
      }
    }
  }
  return Uint8Array.from(bytes);
}

/** Three mantissas under the exponent of the largest; rounded. */
function rgbe(radiance, at) {
  const rgb = [radiance[at], radiance[at + 1], radiance[at + 2]];
  const largest = Math.max(...rgb);
  if (largest < 1e-32) return [0, 0, 0, 0];
  let exponent = Math.floor(Math.log2(largest)) + 1;
  if (Math.round((largest * 256) / 2 ** exponent) > 255) exponent += 1;
  return [...rgb.map((value) => Math.min(Math.round((value * 256) / 2 ** exponent), 255)), exponent + 128];
}
