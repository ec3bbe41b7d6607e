/** Smooth a series of numbers while it is steady and follow it where it changes, by the formula of anyprobe.light.steady. */

import { CONTRACT } from "../core/contract.js";

const C = CONTRACT.filter;

/** a(T): the share of the way in dt seconds. */
const gain = (dt, time) => -Math.expm1(-dt / time);

/** The first value. @param {Float32Array | Float64Array} y */
export function begin(y) {
  return { steady: y, fast: y, last: y, noise: null, memoryS: 0, ageS: 0, stale: 0, staleFast: 0, motion: 0 };
}

/**
 * The state after one more value; the given state is unchanged.
 *
 * @param {ReturnType<typeof begin>} state
 * @param {Float32Array | Float64Array} y
 * @param {number} dt seconds since the last value
 * @param {(one: object, other: object) => number} apart |one - other|
 */
export function advance(state, y, dt, apart) {
  const ageS = state.ageS + dt;
  const difference = apart(y, state.last) / Math.SQRT2;
  let noise = difference;
  if (state.noise !== null) {
    const most = 3 * Math.max(state.noise, C.least_noise);
    noise = state.noise + gain(dt, Math.min(C.noise_s, ageS)) * (Math.min(difference, most) - state.noise);
  }
  const lead = gain(dt, Math.min(C.fast_s, state.memoryS + dt));
  const fast = approach(state.fast, y, lead);
  const spread = apart(fast, state.steady) / (Math.max(noise, C.least_noise) * Math.sqrt(lead / (2 - lead)));
  const motion = Math.min(Math.max((spread - C.calm) / (C.moved - C.calm), 0), 1);
  let memoryS = Math.min(state.memoryS + dt, C.still_s) ** (1 - motion) * C.moving_s ** motion;
  let { stale, staleFast } = motion > C.let_go ? { stale: 1, staleFast: 1 } : state;
  if (stale > C.forgotten) memoryS = Math.min(memoryS, Math.max(state.memoryS, C.moving_s));
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
