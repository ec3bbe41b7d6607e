/** Draw arrays on canvases: photos, the map, the spheres. */

import { falseColor, luminance } from "../../src/core/color.js";
import { displayByte } from "../../src/core/response.js";
import { MAP_HEIGHT, directionToUv } from "../../src/core/latlong.js";
import { levelled } from "../../src/light/light.js";
import { SPHERE_SIZE, displaySphere } from "./spheres.js";

/** Put RGBA bytes on a canvas of exactly their size. */
export function putRgba(canvas, rgba, width, height) {
  canvas.width = width;
  canvas.height = height;
  canvas.getContext("2d").putImageData(new ImageData(rgba, width, height), 0, 0);
}

/**
 * Draw a radiance map as the camera would show it, or its luminance in false colour.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {Float32Array} radiance [64, 128, 3]
 * @param {number} exposureEv
 * @param {boolean} isFalseColor
 */
export function drawMap(canvas, radiance, exposureEv, isFalseColor) {
  const gain = 2 ** exposureEv;
  const rgba = new Uint8ClampedArray((radiance.length / 3) * 4).fill(255);
  for (let from = 0, to = 0; from < radiance.length; from += 3, to += 4) {
    const pixel = radiance.subarray(from, from + 3).map((value) => gain * value);
    rgba.set(isFalseColor ? falseColor(luminance(...pixel)) : pixel.map(displayByte), to);
  }
  putRgba(canvas, rgba, 2 * MAP_HEIGHT, MAP_HEIGHT);
}

/** Where a direction lies in the map: left and top as percentages. */
export function placeOnMap(direction) {
  const [u, v] = directionToUv(...direction);
  return { left: `${100 * u}%`, top: `${100 * v}%` };
}

/** Beyond so many degrees to either side a direction is behind the camera, and up or down it is steep: its side says nothing. */
const [BEHIND_DEG, STEEP_DEG] = [165, 75];

/**
 * A direction in words, as the command line prints it: how far to the right of the camera's view, beyond 90° behind it, and how
 * high above the horizon.
 *
 * @param {number[]} direction unit, in the camera's frame
 * @param {{pitchDeg: number, rollDeg?: number} | null} [ground] null: the horizon is the camera's own, for cut-outs
 */
export function describeDirection(direction, ground = null) {
  const [x, y, back] = ground ? levelled(direction, ground) : direction;
  const degrees = (angle) => Math.round((angle * 180) / Math.PI);
  const azimuth = degrees(Math.atan2(x, -back));
  const elevation = degrees(Math.asin(Math.min(Math.max(y, -1), 1)));
  const side = Math.abs(azimuth) > BEHIND_DEG ? "behind" : `${Math.abs(azimuth)}° ${azimuth < 0 ? "left" : "right"}`;
  const height = `${Math.abs(elevation)}° ${elevation < 0 ? "down" : "up"}`;
  return Math.abs(elevation) < STEEP_DEG ? `${side}, ${height}` : height;
}

/** A sphere of shadeSpheres as the camera would show it at an exposure [EV]. */
export function drawSphere(canvas, sphere, exposureEv) {
  putRgba(canvas, displaySphere(sphere, exposureEv), SPHERE_SIZE, SPHERE_SIZE);
}
