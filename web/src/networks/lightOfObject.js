/** From an object's crop to the light around it: what a still picture and a video's frame have in common. */

import { CONTRACT } from "../core/contract.js";
import { luminance } from "../core/color.js";
import { MAP_HEIGHT, pixelSolidAngles } from "../core/latlong.js";
import { AnyProbeError } from "../errors.js";
import { leaveOut } from "../notices.js";
import { cameraConfidence, cameraRadiance } from "../light/light.js";
import { turnedBack } from "../core/frames.js";
import { backdropDoubts, darkBesideDoubts, isCutOut, isDarkBeside } from "../photo/backdrop.js";
import { CROP_SIZE, contextOf } from "../photo/crop.js";
import { exposureDoubts } from "../photo/exposure.js";
import { groundDoubts, groundOf, upOf } from "../photo/ground.js";
import { coverageOf, seeSurroundings, useSurroundings, withoutTransparent } from "../photo/surroundings.js";
import { measured } from "../light/mirror.js";
import { likelierLook } from "./mirrorLook.js";

/**
 * Luminance of display values between which a pixel says something of the light, and the share of such pixels from which
 * on the object's picture is worth its full confidence.
 */
const { black: BLACK, white: WHITE, enough: ENOUGH, doubt: DOUBT } = CONTRACT.exposure;

/**
 * @typedef {object} LightOptions
 * @property {"auto" | "photo" | "none" | boolean} [surroundings] whether what the picture shows around the object is used:
 *   "auto", unless the object is cut out; "photo" or true, always
 * @property {number} [pitchDeg] how far the camera looks down, where it is known
 * @property {"mode" | "expected"} [emitters] light sources at their most likely positions, or their mean radiance
 * @property {1 | 2} [looks] 2: look in a mirror too, and take the likelier light
 * @property {Float32Array} [material] of photo/material.js, where it is known
 */

/**
 * @param {import("./models.js").Models} models
 * @param {import("../photo/picture.js").Picture} picture
 * @param {number} longFovDeg
 * @param {ReturnType<typeof import("../photo/crop.js").cropObject>} crop
 * @param {LightOptions & {withStages?: boolean, normals?: Float32Array | null, isAlone?: boolean, mirror?: number[]}} options
 *   isAlone: whether the object is cut out, where that is known already; mirror: the object is one of these normals, and of
 *   this reflectance
 */
export async function lightOfObject(models, picture, longFovDeg, crop, options) {
  const { surroundings = "auto", pitchDeg, emitters = "mode", looks = 1, isAlone, mirror, ...given } = options;
  const isLooked = surroundings === "auto" && isAlone === undefined;
  const isCut = isLooked && isCutOut(picture, crop.mask);
  const isDark = isLooked && !isCut && isDarkBeside(picture, crop.mask);
  const isAuto = surroundings === "auto" && !(isAlone ?? (isCut || isDark));
  const isShown = isAuto || surroundings === "photo" || surroundings === true;
  const isOpaque = !isAuto || isAlone !== undefined; // frames have no transparency, and "photo" takes pixels as they are
  const shown = isOpaque ? { picture, opaque: null } : withoutTransparent(picture);
  const seen = isShown && models.lifts ? seeSurroundings(shown.picture, longFovDeg, crop, shown.opaque) : null;
  if (isShown && models.lifts && !seen && !isAuto && isAlone === undefined) {
    throw new AnyProbeError("invalid-option", "expected a picture that shows more than its object, found one colour behind it", { subject: ["surroundings"], remedy: leaveOut("surroundings") });
  }
  const context = isShown && models.completes ? contextOf(shown.picture, crop.mask, crop, shown.opaque) : null;
  const up = isShown && pitchDeg !== undefined ? turnedBack(crop.cameraFromCrop, upOf(pitchDeg)) : null;
  if (given.material && !models.lifts) {
    throw new AnyProbeError("invalid-option", "expected a model that takes it, got the paper's chain", { subject: ["material"], remedy: leaveOut("material") });
  }
  if (looks > 1 && !models.lifts) {
    throw new AnyProbeError("invalid-option", "expected a model that knows where light may come from, got the paper's chain", { subject: ["looks"], remedy: leaveOut("looks") });
  }
  const asked = { ...given, emitters, surroundings: seen, context, up };
  const said = await (looks > 1 ? likelierLook(models, crop, asked) : models.light(crop.image, crop.tanHalf, asked));
  const prediction = mirror ? measured(said, crop.image, given.normals, crop.tanHalf, mirror) : said;
  const ground = isShown ? groundOf(picture, longFovDeg, crop, pitchDeg, prediction.posture) : null;
  const wellExposed = wellExposedFraction(crop.image);
  const worth = Math.min(1, wellExposed / ENOUGH);
  if (prediction.confidence && worth < 1) prediction.confidence = prediction.confidence.map((value) => worth * value);
  const stages = seen ? useSurroundings(prediction, seen, !given.material) : prediction;
  const confidence = cameraConfidence(stages, crop.cameraFromCrop);
  return {
    stages,
    radiance: cameraRadiance(stages, crop.cameraFromCrop),
    confidence,
    meanConfidence: confidence && sphereMean(confidence),
    wellExposedFraction: wellExposed,
    object: prediction.object ?? null,
    uncertainty: prediction.uncertainty ?? null,
    ground: withoutUp(ground),
    warnings: [
      ...exposureDoubts(picture, crop.mask),
      ...(isCut ? backdropDoubts(picture, crop.mask) : isDark ? darkBesideDoubts() : groundDoubts(ground)),
    ],
    emitters: models.lifts ? emitters : "mode",
    hints: {
      surroundings: seen ? coverageOf(seen) : 0,
      normals: Boolean(given.normals),
      material: Boolean(given.material),
    },
  };
}

/** The ground as a light has it. */
function withoutUp(ground) {
  if (ground === null) return null;
  const { up: _, ...rest } = ground;
  return rest;
}

/**
 * Share of the object's pixels in a crop that are neither black nor clipped. In a nearly black object, which is warned of,
 * all pixels up to DOUBT.dark count as black: its map is dark, and a dark map is near to the truth without saying anything
 * about the light.
 */
export function wellExposedFraction(image) {
  const plane = CROP_SIZE * CROP_SIZE;
  let [inside, good, dark, darkGood] = [0, 0, 0, 0];
  for (let i = 0; i < plane; i++) {
    const cover = image[3 * plane + i];
    if (cover <= 0.5) continue;
    inside++;
    const display = luminance(image[i], image[plane + i], image[2 * plane + i]) / cover;
    const isGood = display > BLACK && display < WHITE;
    if (isGood) good++;
    if (display > DOUBT.dark) continue;
    dark++;
    if (isGood) darkGood++;
  }
  if (dark >= DOUBT.dark_share * inside) good -= darkGood;
  return inside ? good / inside : 0;
}

/** Mean over the sphere of one number a pixel. */
function sphereMean(values) {
  const angles = pixelSolidAngles(MAP_HEIGHT);
  let total = 0;
  for (let row = 0, at = 0; row < MAP_HEIGHT; row++) {
    let sum = 0;
    for (const end = at + 2 * MAP_HEIGHT; at < end; at++) sum += values[at];
    total += angles[row] * sum;
  }
  return total / (4 * Math.PI);
}
