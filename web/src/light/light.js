/** Light (noun): what an estimate returns, as anyprobe's Light in Python. */

import { turnedBack } from "../core/frames.js";
import { MAP_HEIGHT } from "../core/latlong.js";
import { described } from "../notices.js";
import { rotate, rotateOne } from "./environment.js";
import { estimatedError, findDominantLight } from "./dominantLight.js";
import { prefilter } from "./prefilter.js";
import { project } from "./harmonics.js";

/**
 * The light around an object in the frame of the photo's camera: right-handed, +X right, +Y up, looking along -Z.
 *
 * Plain arrays, which move between threads; `environment` is made when it is asked for.
 */
export class Light {
  /** @param {ReturnType<typeof describe>} parts */
  constructor(parts) {
    Object.assign(this, parts, described(parts.notices ?? parts.warnings));
  }

  /** The map as a picture of four floats a pixel, for a float texture: row 0 is +Y, the centre column -Z. */
  get environment() {
    const { radiance } = this;
    const data = new Float32Array((radiance.length / 3) * 4).fill(1);
    for (let from = 0, to = 0; from < radiance.length; from += 3, to += 4) {
      data[to] = radiance[from];
      data[to + 1] = radiance[from + 1];
      data[to + 2] = radiance[from + 2];
    }
    return { width: 2 * MAP_HEIGHT, height: MAP_HEIGHT, data };
  }
}

/** What the networks said of a crop, as radiance in the photo's camera frame, never below zero. */
export function cameraRadiance({ radiance }, cameraFromCrop) {
  const turned = rotate(radiance, MAP_HEIGHT, cameraFromCrop);
  for (let i = 0; i < turned.length; i++) if (turned[i] < 0) turned[i] = 0;
  return turned;
}

/**
 * How likely each pixel's display value is within 0.1 of the truth, [64, 128] in the camera's frame.
 *
 * @param {{confidence: Float32Array | null}} stages of Models.light
 * @param {number[]} cameraFromCrop
 * @returns {Float32Array | null} null of a model that does not say
 */
export function cameraConfidence({ confidence }, cameraFromCrop) {
  if (!confidence) return null;
  const turned = rotateOne(confidence, MAP_HEIGHT, cameraFromCrop);
  for (let i = 0; i < turned.length; i++) turned[i] = Math.min(Math.max(turned[i], 0), 1);
  return turned;
}

/**
 * A map with what renderers ask of it.
 *
 * @param {Float32Array} radiance in the camera's frame
 * @param {{expected: Float32Array, cameraFromCrop: number[]} | null} [likely] the networks' map with light sources spread over
 *   all places where they may be, in the crop's frame: the dominant light's error is judged by it
 */
export function describe(radiance, likely = null) {
  const dominant = findDominantLight(radiance, MAP_HEIGHT);
  if (likely && Math.max(...dominant.irradiance) > 0) {
    const direction = turnedBack(likely.cameraFromCrop, dominant.direction);
    dominant.errorDeg = estimatedError(likely.expected, MAP_HEIGHT, direction);
  }
  return { radiance, prefiltered: prefilter(radiance), sh9: project(radiance, MAP_HEIGHT), dominant };
}
