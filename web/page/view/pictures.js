/** Draw arrays on canvases: photos, the map, the spheres. */

import { falseColor, luminance } from "../../src/core/color.js";
import { displayByte } from "../../src/core/response.js";
import { MAP_HEIGHT, directionToUv } from "../../src/core/latlong.js";
import { levelled } from "../../src/light/light.js";
import { SPHERE_SIZE, displaySphere } from "../../src/light/spheres.js";

/** Put RGBA bytes on a canvas of exactly their size. */
export function putRgba(canvas, rgba, width, height) {
  canvas.width = width;
  canvas.height = height;
  canvas.getContext("2d").putImageData(new ImageData(rgba, width, height), 0, 0);
}

/** Draw a [height, width, 3] array through a function of one of its numbers to a byte. */
function putValues(canvas, values, width, height, byteOf) {
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let from = 0, to = 0; from < values.length; from += 3, to += 4) {
    rgba[to] = byteOf(values[from]);
    rgba[to + 1] = byteOf(values[from + 1]);
    rgba[to + 2] = byteOf(values[from + 2]);
    rgba[to + 3] = 255;
  }
  putRgba(canvas, rgba, width, height);
}

/** Luminance of a radiance map in false colour. */
export function drawFalseColor(canvas, radiance) {
  const [width, height] = [2 * MAP_HEIGHT, MAP_HEIGHT];
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let from = 0, to = 0; from < radiance.length; from += 3, to += 4) {
    rgba.set(falseColor(luminance(radiance[from], radiance[from + 1], radiance[from + 2])), to);
    rgba[to + 3] = 255;
  }
  putRgba(canvas, rgba, width, height);
}

/** A map as the camera would show it at an exposure [EV]. */
export function drawMap(canvas, radiance, exposureEv) {
  const gain = 2 ** exposureEv;
  putValues(canvas, radiance, 2 * MAP_HEIGHT, MAP_HEIGHT, (value) => displayByte(gain * value));
}

/** Where a direction lies in the map: left and top as percentages. */
export function placeOnMap(direction) {
  const [u, v] = directionToUv(...direction);
  return { left: `${100 * u}%`, top: `${100 * v}%` };
}

/** Beyond so many degrees to either side a direction is behind the camera: its side says nothing, and jumps. */
const BEHIND_DEG = 165;

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
  return `${side}, ${Math.abs(elevation)}° ${elevation < 0 ? "down" : "up"}`;
}

/** A sphere of shadeSpheres as the camera would show it at an exposure [EV]. */
export function drawSphere(canvas, sphere, exposureEv) {
  putRgba(canvas, displaySphere(sphere, exposureEv), SPHERE_SIZE, SPHERE_SIZE);
}
