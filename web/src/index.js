/** anyprobe: the light around an object of one material, from its picture, in the browser. */

export { AnyProbe } from "./anyprobe.js";
export { Light } from "./light/light.js";
export { irradiance } from "./light/harmonics.js";
export { inverseResponse, response } from "./core/response.js";
export { encodeExr } from "./files/exr.js";
export { encodeHdr } from "./files/hdr.js";
