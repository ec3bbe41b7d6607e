/** A run of numbers kept still while it is still and quick where it changes: anyprobe.light.steady, where the formula stands. */

import { CONTRACT } from "../core/contract.js";

const { filter } = CONTRACT;

export const SMOOTHING = {
  stillS: filter.still_s,
  movingS: filter.moving_s,
  fastS: filter.fast_s,
  noiseS: filter.noise_s,
  leastNoise: filter.least_noise,
  calm: filter.calm,
  moved: filter.moved,
  letGo: filter.let_go,
  forgotten: filter.forgotten,
};

/** a(T): the share of the way in dt seconds. */
const gain = (dt, time) => -Math.expm1(-dt / time);

/** The first value. @param {Float32Array | Float64Array} y */
export function begin(y) {
  return { steady: y, fast: y, last: y, noise: null, memoryS: 0, ageS: 0, stale: 0, staleFast: 0, motion: 0 };
}

/**
 * The state after one more value; the state given stays as it is.
 *
 * @param {ReturnType<typeof begin>} state
 * @param {Float32Array | Float64Array} y
 * @param {number} dt seconds since the last value
 * @param {(one: object, other: object) => number} apart |one - other|
 * @param {typeof SMOOTHING} c
 */
export function advance(state, y, dt, apart, c) {
  const ageS = state.ageS + dt;
  const difference = apart(y, state.last) / Math.SQRT2;
  let noise = difference;
  if (state.noise !== null) {
    const most = 3 * Math.max(state.noise, c.leastNoise);
    noise = state.noise + gain(dt, Math.min(c.noiseS, ageS)) * (Math.min(difference, most) - state.noise);
  }
  const lead = gain(dt, Math.min(c.fastS, state.memoryS + dt));
  const fast = approach(state.fast, y, lead);
  const spread = apart(fast, state.steady) / (Math.max(noise, c.leastNoise) * Math.sqrt(lead / (2 - lead)));
  const motion = Math.min(Math.max((spread - c.calm) / (c.moved - c.calm), 0), 1);
  let memoryS = Math.min(state.memoryS + dt, c.stillS) ** (1 - motion) * c.movingS ** motion;
  let { stale, staleFast } = motion > c.letGo ? { stale: 1, staleFast: 1 } : state;
  if (stale > c.forgotten) memoryS = Math.min(memoryS, Math.max(state.memoryS, c.movingS));
  const share = gain(dt, memoryS);
  const steady = approach(state.steady, fast, share);
  staleFast -= lead * staleFast;
  stale += share * (staleFast - stale);
  return { steady, fast, last: y, noise, memoryS, ageS, stale, staleFast, motion };
}

/** From one towards another by a share of the way. */
function approach(from, towards, share) {
  const moved = new from.constructor(from.length);
  for (let i = 0; i < moved.length; i++) moved[i] = from[i] + share * (towards[i] - from[i]);
  return moved;
}
