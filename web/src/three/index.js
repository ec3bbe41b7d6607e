/** anyprobe/three: estimates in three.js. */

export { installCameraCurve, shadowOpacity } from "./cameraCurve.js";
export { ContactShadow, groundShadowOpacity } from "./contactShadow.js";
export { EnvironmentTexture } from "./environmentTexture.js";
export { MaskOccluder } from "./occluder.js";
export { ProbeLight } from "./probeLight.js";
