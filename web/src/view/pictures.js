/** Arrays drawn on canvases: photos, the networks' stages, the map, the balls. */

import { FALSE_COLOR_MAX, falseColor, luminance } from "../core/color.js";
import { response } from "../core/response.js";
import { MAP_HEIGHT, directionToUv } from "../core/latlong.js";
import { BALL_NAMES, BALL_SIZE } from "../light/balls.js";
import { CROP_SIZE } from "../photo/crop.js";

/** Put RGBA bytes on a canvas of exactly their size. */
export function putRgba(canvas, rgba, width, height) {
  canvas.width = width;
  canvas.height = height;
  canvas.getContext("2d").putImageData(new ImageData(rgba, width, height), 0, 0);
}

/** Draw a [height, width, 3] array through a function of its pixel's three numbers to bytes. */
function putValues(canvas, values, width, height, color) {
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let i = 0; i < width * height; i++) {
    rgba.set(color(values[3 * i], values[3 * i + 1], values[3 * i + 2]), 4 * i);
    rgba[4 * i + 3] = 255;
  }
  putRgba(canvas, rgba, width, height);
}

/** Display values in [0, 1], [128, 128, 3]. */
export function drawIrradiance(canvas, irradiance) {
  putValues(canvas, irradiance, CROP_SIZE, CROP_SIZE, (r, g, b) => [255 * r, 255 * g, 255 * b]);
}

/** Display values, [64, 128, 3]. */
export function drawLdr(canvas, ldr) {
  putValues(canvas, ldr, 2 * MAP_HEIGHT, MAP_HEIGHT, (r, g, b) => [255 * r, 255 * g, 255 * b]);
}

/** Luminance of a radiance map in false colour. */
export function drawFalseColor(canvas, radiance) {
  putValues(canvas, radiance, 2 * MAP_HEIGHT, MAP_HEIGHT, (r, g, b) => falseColor(luminance(r, g, b)));
}

/** The scale beside it, from 0 at the left. */
export function drawFalseColorScale(canvas) {
  const width = 128;
  const values = Float32Array.from({ length: 3 * width }, (_, i) => (Math.floor(i / 3) / (width - 1)) * FALSE_COLOR_MAX);
  putValues(canvas, values, width, 1, (value) => falseColor(value));
}

/** A map as the camera would show it at an exposure [EV]. */
export function drawMap(canvas, radiance, exposureEv) {
  const gain = 2 ** exposureEv;
  putValues(canvas, radiance, 2 * MAP_HEIGHT, MAP_HEIGHT, (...rgb) =>
    rgb.map((value) => 255 * response(gain * value)),
  );
}

/** Where a direction lies in the map: left and top as percentages. */
export function placeOnMap(direction) {
  const [u, v] = directionToUv(...direction);
  return { left: `${100 * u}%`, top: `${100 * v}%` };
}

/** A direction in words: how far to the right of the camera's view and how high. */
export function describeDirection([x, y, z]) {
  const degrees = (angle) => Math.round((angle * 180) / Math.PI);
  const azimuth = degrees(Math.atan2(x, -z));
  const elevation = degrees(Math.asin(Math.min(Math.max(y, -1), 1)));
  const behind = Math.abs(azimuth) > 90 ? ", behind the camera" : "";
  const side = azimuth < 0 ? "left" : "right";
  return `${Math.abs(azimuth)}° ${side}, ${Math.abs(elevation)}° ${elevation < 0 ? "down" : "up"}${behind}`;
}

/** @param {Record<string, HTMLCanvasElement>} canvases by ball @param {object} balls of drawBalls */
export function drawBallPictures(canvases, balls) {
  for (const name of BALL_NAMES) putRgba(canvases[name], balls[name].slice(), BALL_SIZE, BALL_SIZE);
}
