/** What every entry of the package has besides AnyProbe. */

export { AnyProbeError } from "./errors.js";
export { Light } from "./light/light.js";
export { groundShadowOpacity, shadowOpacity } from "./light/groundShadow.js";
export { irradiance } from "./light/harmonics.js";
export { EXPONENT, SIGMA, inverseResponse, response } from "./core/response.js";
export { encodeHdr } from "./files/hdr.js";
