/** The result of an estimate, as Light in Python. */

import { MAP_HEIGHT } from "../core/latlong.js";
import { described } from "../notices.js";
import { directionality, project } from "./harmonics.js";
import { prefilter } from "./prefilter.js";
import { NO_SOURCE, findSources } from "./lightSources.js";

/**
 * The light around an object in the frame of the photo's camera: right-handed, +X right, +Y up, looking along -Z.
 *
 * Plain arrays, which move between threads; `environment` is made on first use.
 */
export class Light {
  /** @param {ReturnType<typeof describe>} parts */
  constructor(parts) {
    Object.assign(this, parts, described(parts.notices ?? parts.warnings));
  }

  /** Whether no light source dominates. */
  get isSoft() {
    return this.soft > 0.5;
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

/** Of directions along -X and X, -Y and Y, -Z and Z. */
const SIDES = [["the left", "the right"], ["below", "above"], ["behind the object", "the camera's side"]];

/** The side that a direction of the photo's frame points to, level where the ground is known. */
export function sideOf(direction, ground) {
  const toward = ground ? levelled(direction, ground) : direction;
  const axis = toward.reduce((best, value, i) => (Math.abs(value) > Math.abs(toward[best]) ? i : best), 0);
  return SIDES[axis][toward[axis] > 0 ? 1 : 0];
}

/** The side that most light comes from, as sideOf. @param {Light} light */
export function brightestSide({ sh9, ground }) {
  return sideOf([3, 1, 2].map((term) => sh9[3 * term] + sh9[3 * term + 1] + sh9[3 * term + 2]), ground);
}

/** A direction of the camera's in a frame whose +Y is up; the camera's azimuth is kept. */
export function levelled([x, y, z], { pitchDeg, rollDeg = 0 }) {
  const [pitch, roll] = [pitchDeg, rollDeg].map((angle) => (angle * Math.PI) / 180);
  const [right, above] = [Math.cos(roll) * x - Math.sin(roll) * y, Math.sin(roll) * x + Math.cos(roll) * y];
  return [right, Math.cos(pitch) * above + Math.sin(pitch) * z, Math.cos(pitch) * z - Math.sin(pitch) * above];
}

/**
 * A map with what renderers need.
 *
 * @param {Float32Array} radiance in the camera's frame
 * @param {{errorDeg?: number, sources?: Float32Array}} [said] by the network: of the dominant light, and on all sources
 */
export function describe(radiance, { errorDeg, sources: said } = {}) {
  const [sources, sh9] = [findSources(radiance, MAP_HEIGHT, said), project(radiance, MAP_HEIGHT)];
  if (errorDeg !== undefined && sources.length > 0) sources[0].errorDeg = errorDeg;
  const dominant = sources[0] ?? NO_SOURCE;
  return { radiance, prefiltered: prefilter(radiance), sh9, sources, dominant, directionality: directionality(sh9) };
}
