/** anyprobe/exr: needs three.js. */

/**
 * A map of `height` rows, three numbers a pixel, as an OpenEXR file of 32-bit floats, the centre column -Z: what EXRLoader of
 * three.js reads needs scene.environmentRotation.y = Math.PI / 2.
 */
export declare function encodeExr(radiance: Float32Array, height: number): Promise<Uint8Array<ArrayBuffer>>;
