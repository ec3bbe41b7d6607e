/** A pinhole lens: its field of view, focal length in pixels and rays. */

import { LENS, wrong } from "../checks.js";
import { CONTRACT } from "../core/contract.js";
import { INPUTS } from "../options.js";

/** Field of view [degrees] of the longer side where nothing else is known: a phone's main camera. */
export const DEFAULT_LONG_FOV_DEG = CONTRACT.lens.default_long_fov_deg;

/** Fields of view that a picture without distortion can have [degrees]. */
const { least: LEAST_FOV_DEG, most: MOST_FOV_DEG } = INPUTS.longFovDeg;

/** Tolerance of a projection: difference of its two focal lengths, and offset of its centre (of half a side). */
const [MOST_UNEVEN, MOST_OFF_CENTRE] = [0.02, 0.05];

const RADIANS = Math.PI / 180;

/** Focal length of a pinhole picture in pixels. */
export function focalPx(width, height, longFovDeg) {
  return Math.max(width, height) / 2 / Math.tan((longFovDeg * RADIANS) / 2);
}

/**
 * The lens of a picture: as the options say, as its file notes it, else a phone's.
 *
 * @param {object} options
 * @param {{width: number, height: number, exifFovDeg?: number | null}} picture
 * @returns {{longFovDeg: number, source: "given" | "exif" | "default"}}
 */
export function lensOf(options, { width, height, exifFovDeg }) {
  const given = longFovOf(options, width, height); // checked in any case
  if (given !== null) return { longFovDeg: given, source: "given" };
  return exifFovDeg ? { longFovDeg: exifFovDeg, source: "exif" } : { longFovDeg: DEFAULT_LONG_FOV_DEG, source: "default" };
}

/**
 * Field of view of the longer side, which the networks' geometry is in; null where none is given.
 *
 * @param {{fovDeg?: number, longFovDeg?: number, projectionMatrix?: ArrayLike<number> | {elements: ArrayLike<number>}}} given
 *   vertical as three.js has it, of the longer side, or a camera's own matrix, column by column
 * @param {number} width of the picture
 */
function longFovOf(given, width, height) {
  const names = LENS.filter((name) => given[name] !== undefined);
  if (names.length > 1) throw wrong("lens", `one of ${LENS.join(", ")}`, names);
  const { fovDeg, longFovDeg, projectionMatrix } = given;
  const half = (degrees) => Math.tan((degrees * RADIANS) / 2);
  const ofLonger = (degrees) => (2 * Math.atan((half(degrees) * Math.max(width, height)) / height)) / RADIANS;
  if (fovDeg !== undefined) return inRange("fovDeg", fovDeg, ofLonger(fovDeg));
  if (longFovDeg !== undefined) return inRange("longFovDeg", longFovDeg, longFovDeg);
  return projectionMatrix === undefined ? null : longFovOfMatrix(projectionMatrix, width, height);
}

function inRange(name, value, longFovDeg) {
  const isFine = (angle) => typeof angle === "number" && angle > LEAST_FOV_DEG && angle < MOST_FOV_DEG;
  if (isFine(value) && isFine(longFovDeg)) return longFovDeg;
  throw wrong(name, `degrees between ${LEAST_FOV_DEG} and ${MOST_FOV_DEG}, of the picture's longer side too`, value);
}

function longFovOfMatrix(matrix, width, height) {
  const m = matrix?.elements ?? matrix;
  if (m?.length !== 16 || ![...m].every(Number.isFinite) || !(m[0] > 0 && m[5] > 0) || m[11] !== -1) {
    throw wrong("projectionMatrix", "16 numbers of a perspective camera, column by column", m?.length === 16 ? [...m] : matrix);
  }
  const [across, down] = [(m[0] * width) / 2, (m[5] * height) / 2]; // focal lengths in pixels
  if (Math.abs(across / down - 1) > MOST_UNEVEN) {
    throw wrong("projectionMatrix", `that of the camera whose picture is ${width} x ${height}`, `another aspect, ${(m[5] / m[0]).toFixed(3)}`);
  }
  if (Math.max(Math.abs(m[8]), Math.abs(m[9])) > MOST_OFF_CENTRE) {
    throw wrong("projectionMatrix", "one that looks through the picture's centre", [m[8], m[9]]);
  }
  return (2 * Math.atan(Math.max(width, height) / 2 / down)) / RADIANS;
}
