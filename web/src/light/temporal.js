/**
 * Lights of a video, kept still on a still scene and quick where the light changes.
 *
 * By the rules of anyprobe.light.temporal: the soft part of a map is averaged pixel by pixel, each discrete source is a
 * Kalman filter; in the world if poses are given. live/frameLight.js calls `step` for each frame that shows the object.
 */

import { luminance } from "../core/color.js";
import { CONTRACT } from "../core/contract.js";
import { turned, unit } from "../core/frames.js";
import { MAP_HEIGHT, pixelSolidAngles } from "../core/latlong.js";
import { rotate } from "./environment.js";
import { BLUR_RADIUS, drawSources, edgeCosine, splitSources } from "./lightSources.js";
import { advance, begin } from "./steady.js";

const { offset: OFFSET, source: rules } = CONTRACT.filter;
const SLOPE = 1 + OFFSET;
const WHITE = Math.log(SLOPE);
const radians = (degrees) => (degrees * Math.PI) / 180;
const [NOISE, DRIFT, GATE] = [rules.noise_deg, rules.drift_deg, rules.gate_deg].map(radians);
/** The pose if none is known. */
const STILL = [1, 0, 0, 0, 1, 0, 0, 0, 1];
/** Seconds for which the object must look the same before its light counts as the same. */
export const SAME_AFTER_S = rules.same_s;

/**
 * The state after one more frame; the given state is unchanged.
 *
 * @param {object | null} state of the last frame, null for the first
 * @param {Float32Array} radiance [64, 128, 3] of this frame
 * @param {number} dt seconds since the last frame, > 0
 * @param {number[] | null} [worldFromCamera] nine numbers, row by row, of this frame's camera when it took the picture; for
 *   all frames or none. The state is then in the world.
 * @param {boolean} [looksSame] whether the object's shading is that of the last frames; false where that is not known
 */
export function step(state, radiance, dt, worldFromCamera = null, looksSame = false) {
  const pose = worldFromCamera ?? STILL;
  const { y, sources } = split(radiance, worldFromCamera);
  if (state === null) return begun(y, sources, pose, Infinity);
  const sameS = looksSame ? state.sameS + dt : 0;
  const isSame = sameS > SAME_AFTER_S;
  const turned = worldFromCamera ? turnedBy(state.pose, pose) : null;
  let tracks = isSame ? state.tracks : state.tracks.map((track) => predicted(track, dt, turned));
  let pairs = pairsOf(tracks, sources);
  const isCut = rms(y, state.soft.fast) > rules.cut;
  const oddS = isCut || showsAnotherLeader(tracks, sources, pairs) ? state.oddS + dt : 0;
  const patience = isSame ? Math.min(state.ledS, rules.patience_s) : 0;
  if (oddS > 0 && oddS <= Math.max(patience, dt)) return { ...state, held: true, oddS, sameS };
  if (isCut && !isSame) return begun(y, sources, pose, sameS);
  if (isSame && oddS > 0) ({ tracks, pairs } = withLeaderAtStrongest(tracks, sources, pairs));
  tracks = ledBy(followed(tracks, sources, pairs, dt), isSame ? Infinity : rules.lead);
  const hasLeader = oddS === 0 && tracks.some(({ leads, isSeen }) => leads && isSeen);
  return {
    soft: advance(state.soft, y, dt, rms),
    tracks,
    pose,
    held: false,
    oddS: isSame ? oddS : 0,
    ledS: hasLeader ? state.ledS + dt : isSame ? state.ledS : 0,
    sameS,
  };
}

const splits = new WeakMap();

/** A map's encoded soft part and its sources, in the world if a pose is known; frames without an answer of their own reuse a map. */
function split(radiance, worldFromCamera) {
  if (!splits.has(radiance)) splits.set(radiance, splitSources(radiance, MAP_HEIGHT));
  const { rest, sources } = splits.get(radiance);
  if (!worldFromCamera) return { y: encode(rest), sources };
  const inWorld = sources.map((one) => ({ ...one, direction: turned(worldFromCamera, one.direction) }));
  return { y: encode(rotate(rest, MAP_HEIGHT, worldFromCamera)), sources: inWorld };
}

/** The first state, or that after a cut. */
function begun(y, sources, pose, sameS) {
  const tracks = ledBy(sources.map((one) => fresh(one, 1)), rules.lead);
  return { soft: begin(y), tracks, pose, held: false, oddS: 0, ledS: 0, sameS };
}

/** The light to show, linear radiance, in the frame that the filter works in. */
export const shown = (state) => drawSources(decode(state.soft.steady), MAP_HEIGHT, shownSources(state));

/** The discrete sources to show, the leader first, in the frame that the filter works in. */
export function shownSources({ tracks }) {
  const [leader, ...others] = [...tracks].sort((a, b) => b.leads - a.leads).map(sourceOf).filter(({ power }) => luminance(...power) > 0);
  if (leader === undefined) return [];
  const weaker = (source) => {
    const most = peakOf(leader) / (rules.margin * Math.max(peakOf(source), 1e-9));
    return most >= 1 ? source : { ...source, power: source.power.map((value) => value * most) };
  };
  return [leader, ...others.map(weaker)];
}

/** A track as a source, of which a share is shown. */
function sourceOf({ direction, size, share }) {
  return { direction, power: [0, 1, 2].map((i) => Math.max(Math.exp(size[i]) - OFFSET, 0) * share), radiusDeg: Math.exp(size[3]) };
}

const sizeOf = ({ power, radiusDeg }) => [...power.map((value) => Math.log(value + OFFSET)), Math.log(radiusDeg)];

function fresh(source, share) {
  const variances = { variance: NOISE ** 2, sizeVariance: rules.size_noise ** 2 };
  return { direction: source.direction, size: sizeOf(source), ...variances, share, isSeen: true, leads: false };
}

/** A track whose variances have grown by dt seconds, and, in the world, by the camera's turn; null: not in the world. */
function predicted(track, dt, turned) {
  const drift = turned === null ? DRIFT : rules.world_drift * DRIFT;
  const variance = track.variance + drift ** 2 * dt + (rules.turn_drift * (turned ?? 0)) ** 2;
  return { ...track, variance, sizeVariance: track.sizeVariance + rules.size_drift ** 2 * dt };
}

/** A track after a measurement of its source; the innovation is limited to the gate. */
function updated(track, source) {
  const gain = track.variance / (track.variance + NOISE ** 2);
  const sizeGain = track.sizeVariance / (track.sizeVariance + rules.size_noise ** 2);
  const part = gain * Math.min(1, GATE / Math.max(angleOf(track.direction, source.direction), 1e-9));
  const size = sizeOf(source);
  return {
    ...track,
    direction: unit(track.direction.map((from, axis) => from + part * (source.direction[axis] - from))),
    size: track.size.map((from, i) => from + sizeGain * (size[i] - from)),
    variance: (1 - gain) * track.variance,
    sizeVariance: (1 - sizeGain) * track.sizeVariance,
    isSeen: true,
  };
}

/** The tracks after one more frame: those measured, those missing and fading, and new ones. */
function followed(tracks, sources, pairs, dt) {
  const fade = Math.min(dt / rules.fade_s, 1);
  const known = tracks.map((track, i) =>
    pairs.has(i)
      ? { ...updated(track, sources[pairs.get(i)]), share: Math.min(track.share + fade, 1) }
      : { ...track, isSeen: false, share: track.share - (track.isSeen ? 0 : fade) },
  );
  const taken = new Set(pairs.values());
  const begunNow = sources.filter((_, j) => !taken.has(j)).map((one) => fresh(one, fade));
  return [...known, ...begunNow].filter(({ share }) => share > 0);
}

/** Match tracks to sources by the least innovation: indices of sources by indices of tracks. */
function pairsOf(tracks, sources) {
  const costs = [];
  tracks.forEach((track, i) => {
    sources.forEach((source, j) => {
      const angle = angleOf(track.direction, source.direction) / (GATE + radians(source.radiusDeg) / 2);
      const size = sizeOf(source);
      const ratio = [0, 1, 2].reduce((sum, k) => sum + Math.abs(track.size[k] - size[k]) / 3, 0);
      if (angle <= 1) costs.push([angle + ratio, i, j]);
    });
  });
  costs.sort((a, b) => a[0] - b[0]);
  const pairs = new Map();
  const taken = new Set();
  for (const [, i, j] of costs) {
    if (pairs.has(i) || taken.has(j)) continue;
    pairs.set(i, j);
    taken.add(j);
  }
  return pairs;
}

/** The leader matched with the frame's strongest source, wherever it is; it is as uncertain as half a frame's noise. */
function withLeaderAtStrongest(tracks, sources, pairs) {
  const leader = tracks.findIndex(({ leads }) => leads);
  if (leader < 0 || sources.length === 0) return { tracks, pairs };
  const ranks = sources.map(strengthOf);
  const first = ranks.indexOf(Math.max(...ranks));
  const doubted = tracks.map((track, at) => (at === leader ? { ...track, variance: Math.max(track.variance, (NOISE / 2) ** 2) } : track));
  const others = [...pairs].filter(([at, j]) => at !== leader && j !== first);
  return { tracks: doubted, pairs: new Map([...others, [leader, first]]) };
}

/** Luminance of a drawn source, summed within BLUR_RADIUS of its middle. */
function peakOf(source) {
  const edge = edgeCosine(source);
  const beyond = Math.max(Math.cos(BLUR_RADIUS) - edge, 0) / (1 - edge);
  return luminance(...source.power) * (1 - beyond * beyond);
}

/** How a source ranks: between its power and what the dominant light goes by, in which wide ones are dull. */
const strengthOf = (source) => Math.sqrt(luminance(...source.power) * peakOf(source));

/** The tracks with their leader marked: the same as before, unless another is `lead` times as strong, or it was not seen. */
function ledBy(tracks, lead) {
  const ranks = tracks.map((track) => (track.isSeen ? strengthOf(sourceOf(track)) : 0));
  const most = Math.max(...ranks);
  const kept = tracks.findIndex(({ leads, isSeen }, at) => leads && isSeen && most <= lead * ranks[at]);
  const leader = kept < 0 ? ranks.indexOf(most) : kept;
  return tracks.map((track, at) => ({ ...track, leads: at === leader }));
}

/** Whether a frame shows another leader than the one that is known. */
function showsAnotherLeader(tracks, sources, pairs) {
  const at = tracks.findIndex(({ leads }) => leads);
  if (at < 0) return false;
  return !pairs.has(at) || Math.max(...sources.map(strengthOf)) > rules.lead * strengthOf(sources[pairs.get(at)]);
}

const distance = (a, b) => Math.sqrt(a.reduce((sum, value, i) => sum + (value - b[i]) ** 2, 0));

const angleOf = (a, b) => 2 * Math.asin(Math.min(distance(a, b) / 2, 1));

/** Angle between two poses. */
const turnedBy = (from, to) => Math.acos(Math.min(Math.max((from.reduce((sum, value, i) => sum + value * to[i], 0) - 1) / 2, -1), 1));

/** y of L. */
function encode(radiance) {
  const y = new Float32Array(radiance.length);
  for (let i = 0; i < y.length; i++) {
    y[i] = Math.log(Math.min(radiance[i], 1) + OFFSET) + Math.max(radiance[i] - 1, 0) / SLOPE;
  }
  return y;
}

function decode(steady) {
  const radiance = new Float32Array(steady.length);
  for (let i = 0; i < radiance.length; i++) {
    const y = steady[i];
    radiance[i] = Math.max(Math.exp(Math.min(y, WHITE)) - OFFSET, 0) + Math.max(y - WHITE, 0) * SLOPE;
  }
  return radiance;
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
