/** anyprobe/exr: needs three.js. */

/** A map of `height` rows, three numbers a pixel, as an OpenEXR file of 32-bit floats. */
export declare function encodeExr(radiance: Float32Array, height: number): Promise<Uint8Array<ArrayBuffer>>;
