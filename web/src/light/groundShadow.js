/** How dark the dominant light's shadow is on the ground, for planes that show only shadows. */

import { AnyProbeError } from "../errors.js";
import { luminance } from "../core/color.js";
import { inverseResponse, response } from "../core/response.js";
import { irradiance } from "./harmonics.js";

/** Largest opacity of a shadow. */
const MOST_SHARE = 0.95;

/**
 * Opacity of black over a display value that removes a share of its light.
 *
 * Exact at middle grey; the curve is close enough to a power that other greys hardly differ.
 */
export function shadowOpacity(share) {
  const grey = 0.5;
  return 1 - response(inverseResponse(grey) * (1 - share)) / grey;
}

/** Refuse anything but a light. */
export function checkIsLight(light) {
  if (light?.dominant && light.sh9) return;
  throw new AnyProbeError("invalid-option", `expected one of probe.estimate, got ${light === null ? "null" : typeof light}`, { subject: ["light"] });
}

/** Opacity of black where the dominant light is hidden, by its share of the ground's light. */
export function groundShadowOpacity(light, up) {
  checkIsLight(light);
  const { dominant, sh9 } = light;
  const ofGround = luminance(...irradiance(sh9, up));
  const cosine = Math.max(dominant.direction.reduce((sum, value, i) => sum + value * up[i], 0), 0);
  const ofDominant = luminance(...dominant.irradiance) * cosine;
  const ofAll = Math.max(ofGround, ofDominant, 1e-6);
  return shadowOpacity(Math.min(ofDominant / ofAll, MOST_SHARE));
}
