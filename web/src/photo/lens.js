/** A pinhole lens: focal length in pixels and rays through them. */

import { CONTRACT } from "../core/contract.js";

/** Field of view [degrees] of the longer side where nothing else is known: a phone's main camera. */
export const DEFAULT_LONG_FOV_DEG = CONTRACT.lens.default_long_fov_deg;

/** Focal length of a pinhole picture in pixels. */
export function focalPx(width, height, longFovDeg) {
  return Math.max(width, height) / 2 / Math.tan((longFovDeg * Math.PI) / 360);
}

/** Direction, camera frame, through the point x, y of a pinhole picture; not of unit length. */
export function pixelDirection([x, y], width, height, longFovDeg) {
  const focal = focalPx(width, height, longFovDeg);
  return [(x - width / 2) / focal, -(y - height / 2) / focal, -1];
}
