/** Check options against the generated options.js: unknown names, wrong types and values out of range are refused in one line. */

import { AnyProbeError } from "./errors.js";
import { INPUTS } from "./options.js";

const about = (...kinds) => Object.keys(INPUTS).filter((name) => kinds.includes(INPUTS[name].about));

const HINTS = about("place").filter((name) => name !== "mask");
/** Options for the same angle; two are only in the browser. */
export const LENS = ["fovDeg", "longFovDeg", "projectionMatrix"];
const LIGHT = about("camera", "light").filter((name) => name !== "longFovDeg" && name !== "normals");
const CALLED = ["onError", "onOutline", "onLost", "onMissed", "onProgress", "pose"];

/** Names of the options of each method. */
export const OPTIONS = {
  load: ["threads", "weights", "runtime", "worker", "onProgress", "signal"],
  fetchMaskNetwork: ["onProgress"],
  mask: [...HINTS, "signal"],
  estimate: [...HINTS, ...LENS, ...LIGHT, "mask", "normals", "signal"],
  track: [...HINTS, ...LENS, ...LIGHT, "mask", "onError", "onLost", "onMissed", "pose", "signal"],
  "tracker.mark": HINTS,
  "tracker.set": LIGHT,
  "tracker.offer": ["pose", "mask", "time"],
  PhotoGround: ["pitchDeg"],
};

/** Options of this package's own page, not documented. */
const OWN = { track: ["onOutline"] };

/** Refuse whatever there is not, and options of another kind or range. @param {keyof OPTIONS} method */
export function checkNames(method, given) {
  if (given === undefined) return;
  if (given === null || typeof given !== "object") throw wrong(method, "an object of options", given);
  const unknown = Object.keys(given).filter((name) => !OPTIONS[method].includes(name) && !OWN[method]?.includes(name));
  if (unknown.length) throw new AnyProbeError("invalid-option", `${method}: unknown option ${unknown.join(", ")}; expected of ${OPTIONS[method].join(", ")}`);
  if (method === "tracker.offer") return; // whose pose is one
  for (const name of CALLED) if (given[name] !== undefined && typeof given[name] !== "function") throw wrong(name, "a function", given[name]);
  const { signal } = given;
  if (signal !== undefined && typeof signal?.throwIfAborted !== "function") throw wrong("signal", "an AbortSignal", signal);
  for (const name of LIGHT) if (given[name] !== undefined) checkOne(name, given[name]);
}

/** Refuse an unknown word, or a number out of bounds. */
function checkOne(name, value) {
  const { words, least, most, unit } = INPUTS[name];
  if (words && ![...words, true, false].includes(value)) throw wrong(name, words.join(", "), value);
  if (least !== undefined && !(typeof value === "number" && value >= least && value <= most)) throw wrong(name, `${least} to ${most} ${unit}`, value);
}

/** @param {string} name @param {string} expected @param {unknown} got */
export function wrong(name, expected, got) {
  return new AnyProbeError("invalid-option", `expected ${expected}, got ${shown(got)}`, { subject: [name] });
}

/** Describe a value in one line. */
export function shown(got) {
  if (typeof got === "function") return "a function";
  if (typeof got === "number" || typeof got === "bigint") return String(got);
  if (ArrayBuffer.isView(got)) return `${got.constructor.name} of ${got.length ?? got.byteLength}`;
  const isPlain = [Object.prototype, Array.prototype, null].includes(got instanceof Object ? Object.getPrototypeOf(got) : null);
  if (!isPlain) return got.constructor?.name ?? "an object";
  try {
    return JSON.stringify(got, (_, value) => (Number.isFinite(value) || typeof value !== "number" ? value : String(value))) ?? String(got);
  } catch {
    return "an object that contains itself";
  }
}

/** Refuse clicks and boxes outside a picture of this size, in its pixels. */
export function checkHints(given, width, height) {
  const size = `${width} x ${height} pixels`;
  const isInside = ([x, y]) => x > -1 && y > -1 && x < width + 1 && y < height + 1; // what is dragged along an edge rounds over it
  for (const name of HINTS) {
    const { numbers, repeated } = INPUTS[name];
    const isOne = (value) => Array.isArray(value) && value.length === numbers && value.every(Number.isFinite);
    const value = given[name];
    if (value === undefined || value === null) continue;
    const all = isOne(value) ? [value] : value;
    const form = repeated ? "[x, y] in pixels, or a list of them" : "[x0, y0, x1, y1] in pixels";
    if (!Array.isArray(all) || !(repeated || all.length === 1) || !all.every(isOne)) throw wrong(name, form, value);
    if (repeated && !all.every(isInside)) throw wrong(name, `points in the picture, ${size}`, value);
    if (repeated) continue;
    const [x0, y0, x1, y1] = value;
    if (!(x1 > x0 && y1 > y0 && isInside([x0, y0]) && isInside([x1, y1]))) throw wrong(name, `x0 < x1 and y0 < y1 in the picture, ${size}`, value);
  }
}
