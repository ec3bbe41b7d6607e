/** Light (noun): what an estimate returns, as anyprobe.infer.result.Light. */

import { MAP_HEIGHT } from "../core/latlong.js";
import { rotate } from "./environment.js";
import { prefilter } from "./prefilter.js";
import { project } from "./harmonics.js";
import { findDominantLight } from "./dominantLight.js";

/**
 * @typedef {object} Light
 * @property {Float32Array} radiance [64, 128, 3] linear Rec. 709 in the photo's exposure units, camera frame
 * @property {Float32Array[]} prefiltered the same blurred for each roughness, as prefilter gives it
 * @property {Float32Array} sh9 27 radiance coefficients in the order of WebXR and three.js
 * @property {ReturnType<typeof findDominantLight>} dominant
 */

/** What the networks said of a crop, as radiance in the photo's camera frame, never below zero. */
export function cameraRadiance({ radiance }, cameraFromCrop) {
  const turned = rotate(radiance, MAP_HEIGHT, cameraFromCrop);
  for (let i = 0; i < turned.length; i++) if (turned[i] < 0) turned[i] = 0;
  return turned;
}

/** A map with what renderers ask of it. */
export function describe(radiance) {
  return {
    radiance,
    prefiltered: prefilter(radiance),
    sh9: project(radiance, MAP_HEIGHT),
    dominant: findDominantLight(radiance, MAP_HEIGHT),
  };
}
