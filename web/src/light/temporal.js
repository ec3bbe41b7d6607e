/**
 * Lights of a video, kept still on a still scene and quick where the light changes.
 *
 * The filter of anyprobe.light.temporal, where its formula stands: two exponential averages of
 * y = ln(L + 0.01), above white a straight line, of which the steady one is shown and chases the fast one.
 */

import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT, pixelSolidAngles } from "../core/latlong.js";

const { filter } = CONTRACT;
const OFFSET = filter.offset;
const SLOPE = 1 + OFFSET;
const WHITE = Math.log(SLOPE);

export const SMOOTHING = {
  stillS: filter.still_s,
  movingS: filter.moving_s,
  fastS: filter.fast_s,
  noiseS: filter.noise_s,
  leastNoise: filter.least_noise,
  cutLevel: filter.cut_level,
  calm: filter.calm,
  moved: filter.moved,
  letGo: filter.let_go,
  forgotten: filter.forgotten,
};

const gain = (dt, time) => -Math.expm1(-dt / time);

function fresh(y) {
  return { steady: y, fast: y, last: y, noise: null, memoryS: 0, ageS: 0, stale: 0, staleFast: 0, held: false };
}

/**
 * The state after one more frame; the state given stays as it is.
 *
 * @param {object | null} state of the last frame, null for the first
 * @param {Float32Array} radiance [64, 128, 3] of this frame
 * @param {number} dt seconds since the last frame, > 0
 */
export function step(state, radiance, dt, smoothing = SMOOTHING) {
  const c = smoothing;
  const y = new Float32Array(radiance.length);
  for (let i = 0; i < y.length; i++) {
    y[i] = Math.log(Math.min(radiance[i], 1) + OFFSET) + Math.max(radiance[i] - 1, 0) / SLOPE;
  }
  if (state === null) return fresh(y);
  if (rms(y, state.fast) > c.cutLevel) return state.held ? fresh(y) : { ...state, held: true };
  const ageS = state.ageS + dt;
  const difference = rms(y, state.last) / Math.SQRT2;
  let noise = difference;
  if (state.noise !== null) {
    const most = 3 * Math.max(state.noise, c.leastNoise);
    noise = state.noise + gain(dt, Math.min(c.noiseS, ageS)) * (Math.min(difference, most) - state.noise);
  }
  const lead = gain(dt, Math.min(c.fastS, state.memoryS + dt));
  const fast = approach(state.fast, y, lead);
  const spread = rms(fast, state.steady) / (Math.max(noise, c.leastNoise) * Math.sqrt(lead / (2 - lead)));
  const motion = Math.min(Math.max((spread - c.calm) / (c.moved - c.calm), 0), 1);
  let memoryS = Math.min(state.memoryS + dt, c.stillS) ** (1 - motion) * c.movingS ** motion;
  let { stale, staleFast } = motion > c.letGo ? { stale: 1, staleFast: 1 } : state;
  if (stale > c.forgotten) memoryS = Math.min(memoryS, Math.max(state.memoryS, c.movingS));
  const share = gain(dt, memoryS);
  const steady = approach(state.steady, fast, share);
  staleFast -= lead * staleFast;
  stale += share * (staleFast - stale);
  return { steady, fast, last: y, noise, memoryS, ageS, stale, staleFast, held: false };
}

/** The light to show, linear radiance. */
export function shown({ steady }) {
  const radiance = new Float32Array(steady.length);
  for (let i = 0; i < radiance.length; i++) {
    const y = steady[i];
    radiance[i] = Math.max(Math.exp(Math.min(y, WHITE)) - OFFSET, 0) + Math.max(y - WHITE, 0) * SLOPE;
  }
  return radiance;
}

/** From one towards another by a share of the way. */
function approach(from, towards, share) {
  const moved = new Float32Array(from.length);
  for (let i = 0; i < moved.length; i++) moved[i] = from[i] + share * (towards[i] - from[i]);
  return moved;
}

/** ln(L + OFFSET) of a y. */
const logarithm = (y) => (y > WHITE ? WHITE + Math.log1p(y - WHITE) : y);

/** Root mean square over the sphere and the channels of the difference of ln(L + OFFSET), of two y. */
function rms(a, b) {
  const weights = pixelSolidAngles(MAP_HEIGHT);
  const line = 2 * MAP_HEIGHT * 3;
  let sum = 0;
  let total = 0;
  for (let row = 0; row < MAP_HEIGHT; row++) {
    let squares = 0;
    for (let i = row * line; i < (row + 1) * line; i++) {
      const difference = logarithm(a[i]) - logarithm(b[i]);
      squares += difference * difference;
    }
    sum += (weights[row] * squares) / line;
    total += weights[row];
  }
  return Math.sqrt(sum / total);
}
