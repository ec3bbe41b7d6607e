/** Three balls under a map: matt, silver, mirror. Seen along -Z by an orthographic camera. */

import { response } from "../core/response.js";
import { MAP_HEIGHT, bilinear, directionToUv } from "../core/latlong.js";
import { halve } from "./environment.js";
import { blurCosinePower } from "./filtering.js";

export const BALL_SIZE = 96;
export const BALL_NAMES = ["matte", "silver", "mirror"];

const SILVER_F0 = 0.9;
/** Sharpness of the cosine lobe about the mirror direction that stands for GGX of alpha 0.3. */
const SILVER_SHARPNESS = 5;
const SMALL = MAP_HEIGHT / 2;

/**
 * The balls as display pictures.
 *
 * @param {Float32Array} radiance [64, 128, 3]
 * @returns {Record<string, Uint8ClampedArray>} RGBA of BALL_SIZE x BALL_SIZE, clear around the ball
 */
export function drawBalls(radiance) {
  const small = halve(radiance, MAP_HEIGHT);
  const lobes = {
    matte: { map: blurCosinePower(small, SMALL, 3, 1), height: SMALL, gain: 1, mirrors: false },
    silver: {
      map: blurCosinePower(small, SMALL, 3, SILVER_SHARPNESS),
      height: SMALL,
      gain: SILVER_F0,
      mirrors: true,
    },
    mirror: { map: radiance, height: MAP_HEIGHT, gain: 1, mirrors: true },
  };
  return Object.fromEntries(Object.entries(lobes).map(([name, lobe]) => [name, drawBall(lobe)]));
}

function drawBall({ map, height, gain, mirrors }) {
  const picture = new Uint8ClampedArray(4 * BALL_SIZE * BALL_SIZE);
  const color = [0, 0, 0];
  for (let row = 0; row < BALL_SIZE; row++) {
    for (let column = 0; column < BALL_SIZE; column++) {
      const x = ((column + 0.5) / BALL_SIZE) * 2 - 1;
      const y = 1 - ((row + 0.5) / BALL_SIZE) * 2;
      const squared = x * x + y * y;
      const radius = Math.sqrt(squared);
      const cover = Math.min(Math.max(((1 - radius) * BALL_SIZE) / 2 + 0.5, 0), 1);
      if (cover === 0) continue;
      const z = Math.sqrt(Math.max(1 - squared, 0));
      const d = mirrors ? [2 * z * x, 2 * z * y, 2 * z * z - 1] : [x, y, z];
      bilinear(map, height, ...directionToUv(...d), color, 0);
      const at = 4 * (row * BALL_SIZE + column);
      for (let c = 0; c < 3; c++) picture[at + c] = 255 * response(gain * color[c]);
      picture[at + 3] = 255 * cover;
    }
  }
  return picture;
}
