/** From a picture and its object's mask to the light around it: what a still picture and a video's frame have in common. */

import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT, pixelSolidAngles } from "../core/latlong.js";
import { measured } from "../light/mirror.js";
import { exposureDoubts } from "../photo/exposure.js";
import { backdropDoubts, groundDoubts, groundOf, upOf } from "../photo/ground.js";
import { objectBox } from "../photo/picture.js";
import { graphInputs } from "./lightGraph.js";

/** The share of the object's pixels, neither black nor clipped, from which on its picture is worth its full confidence. */
const ENOUGH = CONTRACT.exposure.enough;

/**
 * @typedef {object} LightOptions
 * @property {"auto" | "photo" | "none" | boolean} [surroundings] whether what the picture shows around the object is used:
 *   "auto", unless the object is cut out; "photo" or true, always
 * @property {number} [pitchDeg] how far the camera looks down, where it is known
 * @property {Float32Array} [material] of photo/material.js, where it is known
 * @property {boolean} [isLensKnown] whether the field of view is the picture's own
 */

/**
 * @param {LightOptions & {normals?: Float32Array | null, mirror?: number[]}} options normals: of every pixel, camera frame;
 *   mirror: the object is one of these normals, and of this reflectance
 */
export async function lightOfObject(models, picture, mask, longFovDeg, options) {
  const { surroundings = "auto", pitchDeg, isLensKnown, normals, material, mirror } = options;
  const believe = surroundings === "photo" || surroundings === true;
  const isShown = believe || surroundings === "auto";
  const isClear = isShown && !believe && isPartlyClear(picture) ? (pixel) => picture.rgba[4 * pixel + 3] < 128 : () => false;
  const coverOf = isShown ? (pixel) => (isClear(pixel) ? 0 : 1) : () => 0;
  const up = isShown && pitchDeg !== undefined ? upOf(pitchDeg) : null;
  const inputs = graphInputs(picture, mask, longFovDeg, { isLensKnown, coverOf, up, normals, material, believe });
  const said = await models.light(inputs);
  const wellExposed = said.well_exposed[0];
  const { radiance, confidence } = mirror ? withMirror(said, mirror, Math.min(1, wellExposed / ENOUGH)) : said;
  const isUsed = isShown && said.believed[0] > CONTRACT.graph.place;
  const [fovDeg, fovErrorDeg] = said.field_of_view;
  const ground = isUsed ? groundOf(picture, mask, objectBox(mask, picture.width), pitchDeg, said.posture) : null;
  const [metal, red, green, blue, reflectance] = said.object_material;
  const [errorDeg, level, colorDeg] = said.errors;
  return {
    radiance,
    confidence,
    meanConfidence: sphereMean(confidence),
    wellExposedFraction: wellExposed,
    object: { metal, reflectance: [red, green, blue], reflectanceStops: reflectance / Math.LN2 },
    uncertainty: { levelStops: level / Math.LN2, colorDeg },
    said: { errorDeg, sources: said.sources },
    soft: said.soft[0],
    outdoors: said.outdoors[0],
    ground,
    // narrowed by its error: spheres drawn too long are seen, those drawn too round are not
    lens: isLensKnown ? undefined : { longFovDeg: fovDeg - fovErrorDeg, source: "estimated" },
    warnings: [
      ...exposureDoubts(picture, mask),
      ...(isShown && !isUsed ? backdropDoubts(inputs.photo[0]) : groundDoubts(ground)),
    ],
    hints: {
      surroundings: sphereMean(said.seen.filter((_, i) => i % 4 === 3)),
      normals: Boolean(normals),
      material: Boolean(material),
    },
  };
}

/** Transparency of all or none says nothing. */
function isPartlyClear({ width, height, rgba }) {
  let clear = 0;
  for (let at = 3; at < rgba.length; at += 4) clear += rgba[at] < 128;
  return clear > 0 && clear < width * height;
}

/** The map and its confidence by what a mirror shows, but for what is seen beside it. */
function withMirror(said, f0, worth) {
  const found = measured(said, f0, worth);
  const keep = (values, channels, own) =>
    values.map((value, i) => value + said.seen[4 * Math.floor(i / channels) + 3] * (own[i] - value));
  return { radiance: keep(found.radiance, 3, said.radiance), confidence: keep(found.confidence, 1, said.confidence) };
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
