/** The camera's curve for three.js: objects are shown by the same curve that the photo was taken with. */

import { ShaderChunk } from "three";
import { EXPONENT, SIGMA, inverseResponse, response } from "../core/response.js";

const SLOT = "vec3 CustomToneMapping( vec3 color ) { return color; }";

/** Put the curve into the place three.js keeps for one; renderers ask for CustomToneMapping. */
export function installCameraCurve() {
  const [n, s] = [EXPONENT, SIGMA].map((value) => value.toFixed(6));
  const curve = `vec3 CustomToneMapping( vec3 color ) {
    vec3 x = pow( clamp( toneMappingExposure * color, 0.0, 1.0 ), vec3( ${n} ) );
    return ( 1.0 + ${s} ) * x / ( x + ${s} );
  }`;
  if (!ShaderChunk.tonemapping_pars_fragment.includes(SLOT)) {
    throw new Error("three.js has moved its place for a curve of one's own");
  }
  ShaderChunk.tonemapping_pars_fragment = ShaderChunk.tonemapping_pars_fragment.replace(SLOT, curve);
}

/**
 * How opaque black must be laid over a display value so that its light is less by a share.
 *
 * Exact at middle grey; the curve is close enough to a power that other greys hardly differ.
 */
export function shadowOpacity(share) {
  const grey = 0.5;
  return 1 - response(inverseResponse(grey) * (1 - share)) / grey;
}
