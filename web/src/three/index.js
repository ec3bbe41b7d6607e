/** anyprobe/three: estimates in three.js; types/three.d.ts says what each method takes and gives. */

export { groundShadowOpacity, shadowOpacity } from "../light/groundShadow.js";
export { installCameraCurve } from "./cameraCurve.js";
export { ContactShadow } from "./contactShadow.js";
export { EnvironmentTexture } from "./environmentTexture.js";
export { MaskOccluder } from "./occluder.js";
export { PhotoGround } from "./photoGround.js";
export { ProbeLight } from "./probeLight.js";
