/** What every entry of the package has besides AnyProbe. */

export { AnyProbeError } from "./errors.js";
export { Light } from "./light/light.js";
export { irradiance } from "./light/harmonics.js";
export { inverseResponse, response } from "./core/response.js";
export { encodeExr } from "./files/exr.js";
export { encodeHdr } from "./files/hdr.js";
