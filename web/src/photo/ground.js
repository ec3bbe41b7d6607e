/** The ground under the object, as anyprobe.estimate.ground. */

import { luminance } from "../core/color.js";
import { CONTRACT } from "../core/contract.js";
import { focalPx } from "./lens.js";
import { give, notice } from "../notices.js";

const GROUND = CONTRACT.ground;
const RADIANS = Math.PI / 180;

/**
 * The place where an object touches the ground: the middle of its mask's lower border.
 *
 * @param {number} width of the picture
 * @param {number[]} box x0, y0, x1, y1 of mask > 0.5
 * @returns {number[]} x, y in pixels
 */
export function contactOf(mask, width, [x0, y0, x1, y1]) {
  const least = GROUND.least_contact * (x1 - x0);
  let row = y1;
  const countIn = (y) => {
    let count = 0;
    for (let x = x0; x < x1; x++) if (mask[y * width + x] > 0.5) count++;
    return count;
  };
  while (row > y0 + 1 && countIn(row - 1) < least) row--;
  let [sum, count] = [0, 0];
  for (let y = Math.max(Math.floor(row - GROUND.contact_band * (y1 - y0)), y0); y < row; y++) {
    for (let x = x0; x < x1; x++) {
      if (mask[y * width + x] <= 0.5) continue;
      sum += x + 0.5;
      count++;
    }
  }
  return [count ? sum / count : (x0 + x1) / 2, row];
}

/**
 * A pitch that was found, by default the usual one [degrees], or as much more as it takes to see the ground at a row
 * `least_slope_deg` below the horizon.
 *
 * @param {number} row of the real object's base
 * @param {number} height of the picture
 * @param {number} focal pixels
 */
export function likelyPitchDeg(row, height, focal, foundDeg = GROUND.usual_pitch_deg) {
  return Math.max(foundDeg, GROUND.least_slope_deg - Math.atan2(row - height / 2, focal) / RADIANS);
}

/** Up [3] in the frame of a camera of this pitch and roll. */
export function upOf(pitchDeg, rollDeg = 0) {
  const [pitch, roll] = [pitchDeg * RADIANS, rollDeg * RADIANS];
  return [Math.cos(pitch) * Math.sin(roll), Math.cos(pitch) * Math.cos(roll), Math.sin(pitch)];
}

/**
 * The ground of a picture that is no cut-out.
 *
 * @param {number[]} box of the mask's object
 * @param {number | undefined} pitchDeg how far the camera looks down, where it is known
 * @param {Float32Array} posture of Models.light: pitch, roll and the pitch's mean error [degrees]
 * @returns {{pitchDeg: number, pitchErrorDeg: number, rollDeg: number, contact: number[], source: "given" | "estimated"}}
 */
export function groundOf({ width }, mask, box, pitchDeg, posture) {
  const contact = contactOf(mask, width, box);
  if (pitchDeg !== undefined) return { pitchDeg, pitchErrorDeg: GROUND.given_error_deg, rollDeg: 0, contact, source: "given" };
  const [foundDeg, rollDeg, errorDeg] = posture;
  const pitchErrorDeg = Math.sqrt(Math.PI / 2) * errorDeg;
  return { pitchDeg: foundDeg, pitchErrorDeg, rollDeg, contact, source: "estimated" };
}

/**
 * A line where the pitch is estimated badly; anyprobe.estimate.doubts has the same.
 *
 * @param {ReturnType<typeof groundOf> | null} ground
 * @returns {import("../notices.js").Notice[]}
 */
export function groundDoubts(ground) {
  if (ground?.source !== "estimated" || ground.pitchErrorDeg <= GROUND.unsure_deg) return [];
  const { pitchDeg, pitchErrorDeg } = ground;
  const pitch = `${Math.abs(pitchDeg).toFixed(0)} degrees ${Math.round(pitchDeg) < 0 ? "up" : "down"}`;
  return [notice("pitch-unsure", `the camera seems to look ${pitch}, give or take ${pitchErrorDeg.toFixed(0)}`, give("pitchDeg"))];
}

/**
 * A line where what is beside the object of an opaque cut-out is bright enough for a studio's backdrop;
 * anyprobe.estimate.refine has the same.
 *
 * @param {Float32Array} photo [N, 5] of graphInputs
 * @returns {import("../notices.js").Notice[]}
 */
export function backdropDoubts(photo) {
  const levels = [];
  for (let at = 0; at < photo.length; at += 5) {
    if (!(photo[at + 3] > 0.5)) return [];
    if (photo[at + 4] < 0.5) levels.push(luminance(photo[at], photo[at + 1], photo[at + 2]));
  }
  if (levels.length === 0 || median(levels) <= GROUND.backdrop_level) return [];
  const text = "the background does not look like the object's surroundings, and is not used; if it is, ask for it";
  return [notice("plain-backdrop", text, [{ do: "give", name: "surroundings", value: "photo" }])];
}

/** @param {number[]} values */
export function median(values) {
  const sorted = Float64Array.from(values).sort();
  const middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}
