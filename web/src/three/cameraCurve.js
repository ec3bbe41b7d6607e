/** The camera's curve for three.js: objects are shown by the same curve that the photo was taken with. */

import { CustomToneMapping, ShaderChunk } from "three";
import { EXPONENT, SIGMA } from "../core/response.js";

const SLOT = "vec3 CustomToneMapping( vec3 color ) { return color; }";

/** The curve's display value, as the linear value that three.js will encode to it by sRGB. */
const CURVE = `vec3 CustomToneMapping( vec3 color ) {
  vec3 x = pow( clamp( toneMappingExposure * color, 0.0, 1.0 ), vec3( ${EXPONENT.toFixed(6)} ) );
  vec3 display = ${(1 + SIGMA).toFixed(6)} * x / ( x + ${SIGMA.toFixed(6)} );
  return mix( pow( ( display + 0.055 ) / 1.055, vec3( 2.4 ) ), display / 12.92, vec3( lessThanEqual( display, vec3( 0.04045 ) ) ) );
}`;

/**
 * Let a renderer show radiance in the photo's exposure units as the photo's camera does: 1 is white. The curve fills the place
 * that three.js keeps for one (CustomToneMapping), for every renderer that asks for it; call this before the first picture is
 * drawn.
 */
export function installCameraCurve(renderer) {
  const chunk = ShaderChunk.tonemapping_pars_fragment;
  if (chunk.includes(SLOT)) ShaderChunk.tonemapping_pars_fragment = chunk.replace(SLOT, CURVE);
  else if (!chunk.includes(CURVE)) throw new Error("three.js: expected an empty CustomToneMapping, found another curve there");
  renderer.toneMapping = CustomToneMapping;
  renderer.toneMappingExposure = 1;
}
