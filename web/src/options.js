/** What is asked for, checked: unknown names, kinds and ranges are refused in one line. */

import { CONTRACT } from "./core/contract.js";
import { AnyProbeError } from "./errors.js";
import { DEFAULT_LONG_FOV_DEG } from "./photo/lens.js";
import { didYouMean } from "./spelling.js";

const HINTS = ["click", "exclude", "box"];
const LENS = ["fovDeg", "longFovDeg", "projectionMatrix"];
const LIGHT = ["surroundings", "pitchDeg", "material"];
const SURROUNDINGS = ["auto", "photo", "none", true, false];

/** Names of the options of each method. */
export const OPTIONS = {
  load: ["engine", "threads", "weights", "runtime", "worker", "onProgress", "signal"],
  fetchMaskNetwork: ["onProgress"],
  mask: [...HINTS, "signal"],
  estimate: [...HINTS, ...LENS, ...LIGHT, "mask", "normals", "signal"],
  track: [...HINTS, ...LENS, ...LIGHT, "mask", "onError", "onLost", "onMissed", "pose", "signal"],
  "tracker.mark": HINTS,
  "tracker.set": LIGHT,
  "tracker.offer": ["pose", "mask", "time"],
  PhotoGround: ["pitchDeg"],
};

/** What this package's page alone gives, and nobody is told of. */
const OWN = { track: ["withViews"] };

/** Angles that a picture without distortion can have, degrees. */
const { least_fov_deg: LEAST_FOV_DEG, most_fov_deg: MOST_FOV_DEG } = CONTRACT.lens;

/** By how much the two focal lengths of a projection may differ, and its centre lie beside the picture's (of half its side). */
const [MOST_UNEVEN, MOST_OFF_CENTRE] = [0.02, 0.05];

/**
 * The lens of a picture: as the options say, as its file notes it, else a phone's.
 *
 * @param {object} options
 * @param {{width: number, height: number, exifFovDeg?: number | null}} picture
 * @returns {{longFovDeg: number, source: "given" | "exif" | "default"}}
 */
export function lensOf(options, { width, height, exifFovDeg }) {
  const given = longFovOf(options, width, height); // checked in any case
  if (LENS.some((name) => options[name] !== undefined)) return { longFovDeg: given, source: "given" };
  return exifFovDeg ? { longFovDeg: exifFovDeg, source: "exif" } : { longFovDeg: given, source: "default" };
}

/** Refuse whatever there is not. @param {keyof OPTIONS} method */
export function checkNames(method, given) {
  if (given === undefined) return;
  if (given === null || typeof given !== "object") throw wrong(method, "an object of options", given);
  const unknown = Object.keys(given).filter((name) => !OPTIONS[method].includes(name) && !OWN[method]?.includes(name));
  if (unknown.length === 0) return method === "tracker.offer" ? undefined : checkKinds(given); // whose pose is one
  const meant = didYouMean(unknown[0], OPTIONS[method]);
  throw new AnyProbeError("invalid-option", `${method}: unknown option ${unknown.join(", ")}; expected of ${OPTIONS[method].join(", ")}${meant}`);
}

/** What is called, and what gives up. */
function checkKinds(given) {
  for (const name of ["onError", "onLost", "onMissed", "onProgress", "pose"]) {
    if (given[name] !== undefined && typeof given[name] !== "function") throw wrong(name, "a function", given[name]);
  }
  const { signal } = given;
  if (signal !== undefined && typeof signal?.throwIfAborted !== "function") throw wrong("signal", "an AbortSignal", signal);
}

/** @param {string} name @param {string} expected @param {unknown} got @param {unknown[]} [known] all that it may be */
export function wrong(name, expected, got, known = []) {
  return new AnyProbeError("invalid-option", `expected ${expected}, got ${shown(got)}${didYouMean(got, known)}`, { subject: [name] });
}

/** Something in a line. */
export function shown(got) {
  if (typeof got === "function") return "a function";
  if (typeof got === "number") return String(got);
  if (ArrayBuffer.isView(got)) return `${got.constructor.name} of ${got.length ?? got.byteLength}`;
  const isPlain = [Object.prototype, Array.prototype, null].includes(got instanceof Object ? Object.getPrototypeOf(got) : null);
  if (!isPlain) return got.constructor?.name ?? "an object";
  try {
    return JSON.stringify(got, (_, value) => (Number.isFinite(value) || typeof value !== "number" ? value : String(value))) ?? String(got);
  } catch {
    return typeof got === "bigint" ? String(got) : "an object that contains itself";
  }
}

/** The kind of light that is wanted. */
export function checkLight({ surroundings, pitchDeg }) {
  if (surroundings !== undefined && !SURROUNDINGS.includes(surroundings)) throw wrong("surroundings", "auto, photo or none", surroundings, ["auto", "photo", "none"]);
  if (pitchDeg !== undefined && !(typeof pitchDeg === "number" && Math.abs(pitchDeg) <= 90)) throw wrong("pitchDeg", "-90 to 90 degrees that the camera looks down", pitchDeg);
}

/** Clicks and boxes that lie in a picture of this size, which they are in pixels of. */
export function checkHints({ click, exclude, box }, width, height) {
  const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
  const isPoint = (point) => Array.isArray(point) && point.length === 2 && point.every(isNumber);
  const isInside = ([x, y]) => x > -1 && y > -1 && x < width + 1 && y < height + 1; // what is dragged along an edge rounds over it
  const size = `${width} x ${height} pixels`;
  for (const [name, points] of Object.entries({ click, exclude })) {
    if (points === undefined || points === null) continue;
    const all = isPoint(points) ? [points] : points;
    if (!Array.isArray(all) || !all.every(isPoint)) throw wrong(name, "[x, y] in pixels, or a list of them", points);
    if (!all.every(isInside)) throw wrong(name, `points in the picture, ${size}`, points);
  }
  if (box === undefined || box === null) return;
  if (!Array.isArray(box) || box.length !== 4 || !box.every(isNumber)) throw wrong("box", "[x0, y0, x1, y1] in pixels", box);
  const [x0, y0, x1, y1] = box;
  if (!(x1 > x0 && y1 > y0 && isInside([x0, y0]) && isInside([x1, y1]))) {
    throw wrong("box", `x0 < x1 and y0 < y1 in the picture, ${size}`, box);
  }
}

/**
 * Field of view of the longer side, which the networks' geometry is in.
 *
 * @param {{fovDeg?: number, longFovDeg?: number, projectionMatrix?: ArrayLike<number> | {elements: ArrayLike<number>}}} lens
 *   vertical as three.js has it, of the longer side, or a camera's own matrix, column by column
 * @param {number} width of the picture
 * @param {number} height
 */
export function longFovOf({ fovDeg, longFovDeg, projectionMatrix }, width, height) {
  const given = { fovDeg, longFovDeg, projectionMatrix };
  const names = LENS.filter((name) => given[name] !== undefined);
  if (names.length > 1) throw wrong("lens", `one of ${LENS.join(", ")}`, names);
  const longer = Math.max(width, height);
  const ofSide = (side, of) => (2 * Math.atan((Math.tan((of * Math.PI) / 360) * longer) / side) * 180) / Math.PI;
  if (fovDeg !== undefined) return inRange("fovDeg", fovDeg, ofSide(height, fovDeg));
  if (longFovDeg !== undefined) return inRange("longFovDeg", longFovDeg, longFovDeg);
  return projectionMatrix === undefined ? DEFAULT_LONG_FOV_DEG : longFovOfMatrix(projectionMatrix, width, height);
}

function inRange(name, value, longFovDeg) {
  const isFine = (angle) => typeof angle === "number" && angle > LEAST_FOV_DEG && angle < MOST_FOV_DEG;
  if (isFine(value) && isFine(longFovDeg)) return longFovDeg;
  throw wrong(name, `degrees between ${LEAST_FOV_DEG} and ${MOST_FOV_DEG}, of the picture's longer side too`, value);
}

/** By how much a rotation's columns may be off unit length and right angles. */
const MOST_SKEW = 0.01;

/**
 * The rotation of a camera's pose in the world, nine numbers row by row.
 *
 * @param {ArrayLike<number> | {elements: ArrayLike<number>} | {matrix: ArrayLike<number>} | {matrixWorld: object}} pose
 *   16 numbers column by column (a Matrix4, an XRRigidTransform, a three.js camera), or nine row by row; as it is now
 */
export function rotationOfPose(pose) {
  const given = pose.matrixWorld ?? pose;
  const m = given.elements ?? given.matrix ?? given;
  if (![9, 16].includes(m.length) || !Array.from(m).every(Number.isFinite)) {
    throw wrong("pose", "16 numbers column by column, or 9 row by row", m.length === undefined ? pose : Array.from(m));
  }
  const rotation = m.length === 9 ? [...m] : [0, 1, 2].flatMap((row) => [m[row], m[4 + row], m[8 + row]]);
  const column = (c) => [rotation[c], rotation[3 + c], rotation[6 + c]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const [x, y, z] = [0, 1, 2].map(column);
  const skew = Math.max(...[x, y, z].map((one) => Math.abs(dot(one, one) - 1)), ...[dot(x, y), dot(y, z), dot(z, x)].map(Math.abs));
  const turns = dot(x, [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]);
  if (skew > MOST_SKEW || turns < 0) throw wrong("pose", "a rotation of unit scale", rotation);
  return rotation;
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
  return (2 * Math.atan(Math.max(width, height) / 2 / down) * 180) / Math.PI;
}
