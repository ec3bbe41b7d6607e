/**
 * Lights of a video, kept still on a still scene and quick where the light changes.
 *
 * The filter of anyprobe.light.temporal, where its rules stand: the soft part of a map is filtered pixel by pixel, its
 * discrete sources as objects; in the world, where poses are given.
 */

import { luminance } from "../core/color.js";
import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT, pixelSolidAngles } from "../core/latlong.js";
import { rotate } from "./environment.js";
import { drawSources, splitSources } from "./sourceSplit.js";
import { SMOOTHING, advance, approach, begin, gain } from "./steady.js";

const { offset: OFFSET, source: rules } = CONTRACT.filter;
const SLOPE = 1 + OFFSET;
const WHITE = Math.log(SLOPE);
const radians = (degrees) => (degrees * Math.PI) / 180;
const [GATE, SLACK, MOST_TURN] = [rules.gate_deg, rules.slack_deg, rules.most_turn_deg_s].map(radians);
const LN_RATIO = Math.log(rules.gate_ratio);
const [VIEW_TURN, VIEW_MOST_TURN] = [radians(rules.view.turn_deg), radians(rules.view.most_turn_deg_s)];
const [VIEW_SLACK, VIEW_SLACK_SIZE] = [radians(rules.view.slack_deg), Math.sqrt(3) * Math.log(rules.view.slack_ratio)];
const RECENT_S = rules.view.recent_s;
/** Stands for the pose where none is known. */
const STILL = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const { patience_s: PATIENCE_S, fade_s: FADE_S, most: MOST, lead_ratio: LEAD_RATIO, lead_margin: LEAD_MARGIN } = rules;
const { odd_s: [LEAST_ODD_S, MOST_ODD_S] } = rules.same;
/** Seconds for which the object must look the same before its light is taken to be. */
export const SAME_AFTER_S = rules.same.after_s;
const SAME_MOST_TURN = radians(rules.same.most_turn_deg_s);
/** Of the cap within which findDominantLight compares. */
const PEAK = radians(CONTRACT.dominant_light.blur_deg);

/**
 * The state after one more frame; the state given stays as it is.
 *
 * @param {object | null} state of the last frame, null for the first
 * @param {Float32Array} radiance [64, 128, 3] of this frame
 * @param {number} dt seconds since the last frame, > 0
 * @param {number[] | null} [worldFromCamera] nine numbers, row by row, of this frame's camera when it took the picture; for
 *   all frames or none. The state is then in the world.
 * @param {boolean} [looksSame] whether the object's shading is that of the last frames; false where that is not known
 */
export function step(state, radiance, dt, worldFromCamera = null, looksSame = false, smoothing = SMOOTHING) {
  const pose = worldFromCamera ?? STILL;
  const { y, sources } = worldFromCamera ? splitInWorld(radiance, worldFromCamera) : split(radiance);
  const power = Float64Array.of(Math.log(OFFSET + sources.reduce((sum, one) => sum + luminance(...one.power), 0)));
  if (state === null) return begun(y, power, sources, pose, SAME_AFTER_S);
  const sameS = looksSame ? state.sameS + dt : 0;
  const isSame = sameS > SAME_AFTER_S;
  const pairs = pairsOf(state.tracks, sources);
  const isCut = rms(y, state.soft.fast) > smoothing.cutLevel;
  const oddS = isCut || showsAnotherLeader(state.tracks, sources, pairs) ? state.oddS + dt : 0;
  const patience = isSame ? Math.min(Math.max(state.ledS, LEAST_ODD_S), MOST_ODD_S) : dt;
  if (oddS > 0 && oddS <= patience) return { ...state, held: true, oddS, sameS };
  if (isCut && !isSame) return begun(y, power, sources, pose, sameS);
  const known = isSame && oddS > 0 ? movedLeader(state.tracks, sources, pairs) : { tracks: state.tracks, pairs };
  const tracks = follow(known.tracks, sources, known.pairs, pose, dt, smoothing, isSame);
  const leader = leaderOf(tracks, isSame);
  return {
    soft: advance(state.soft, y, dt, rms, smoothing),
    power: advance(state.power, power, dt, distance, smoothing),
    tracks: ledBy(leader, tracks),
    held: false,
    oddS: isSame ? 0 : oddS,
    ledS: oddS === 0 && tracks[leader]?.leads ? state.ledS + dt : 0,
    sameS,
  };
}

const splits = new WeakMap();

/** A map's soft part, encoded, and its sources; worked out once, as frames without an answer of their own have the last one. */
function split(radiance) {
  if (!splits.has(radiance)) {
    const { soft, sources } = splitSources(radiance, MAP_HEIGHT);
    splits.set(radiance, { y: encode(soft), sources });
  }
  return splits.get(radiance);
}

function splitInWorld(radiance, worldFromCamera) {
  const { soft, sources } = splitSources(radiance, MAP_HEIGHT);
  const turnedSources = sources.map((one) => ({ ...one, direction: turned(worldFromCamera, one.direction) }));
  return { y: encode(turn(soft, worldFromCamera)), sources: turnedSources };
}

/** The first state, or that after a cut. */
function begun(y, power, sources, pose, sameS) {
  const tracks = sources.map((one) => fresh(one, pose, 1));
  return { soft: begin(y), power: begin(power), tracks: ledBy(leaderOf(tracks), tracks), held: false, oddS: 0, ledS: 0, sameS };
}

/** The light to show, linear radiance, in a camera's frame. @param {number[] | null} [worldFromCamera] as of step */
export function shown(state, worldFromCamera = null) {
  let map = decode(state.soft.steady);
  let sources = shownSources(state);
  if (worldFromCamera) {
    const cameraFromWorld = transposed(worldFromCamera);
    map = turn(map, cameraFromWorld);
    sources = sources.map((one) => ({ ...one, direction: turned(cameraFromWorld, one.direction) }));
  }
  return drawSources(map, MAP_HEIGHT, sources);
}

/** The discrete sources to show, in the frame that the filter works in. */
export function shownSources({ tracks, power }) {
  const whole = tracks.map((track) => ({ ...sourceOf(track), share: track.share }));
  const asked = whole.reduce((sum, one) => sum + one.share * luminance(...one.power), 0);
  const there = Math.max(Math.exp(power.steady[0]) - OFFSET, 0);
  const scale = asked > 0 ? Math.min(1, there / asked) : 0;
  const found = whole.map(({ direction, radius, power: own, share }) => ({ direction, radius, power: own.map((value) => value * scale * share) }));
  tracks.forEach(({ leads }, at) => leads && putFirst(found, at));
  return found;
}

/** What is known of the sources after one more frame. */
function follow(tracks, sources, pairs, pose, dt, smoothing, isSame) {
  const followed = tracks.map((track, i) => (pairs.has(i) ? seen(track, sources[pairs.get(i)], pose, dt, smoothing, isSame) : unseen(track, dt)));
  const taken = new Set(pairs.values());
  sources.forEach((one, j) => taken.has(j) || followed.push(fresh(one, pose, Math.min(dt / FADE_S, 1))));
  return followed
    .filter(({ share }) => share > 0)
    .sort((a, b) => b.share - a.share) // stable: of equals the older one stays
    .slice(0, MOST);
}

/** Luminance of a drawn source, summed within PEAK of its middle; share of its power. */
function peakOf({ power, radius }, share = 1) {
  const beyond = Math.max(Math.cos(PEAK) - Math.cos(radius), 0) / (1 - Math.cos(radius));
  return luminance(...power) * share * (1 - beyond * beyond);
}

/** How a source ranks: between its power and what the dominant light goes by, in which wide ones are dull. */
const strengthOf = (source, share = 1) => Math.sqrt(luminance(...source.power) * share * peakOf(source, share));

/** The tracks with the leader's place at the frame's strongest source, and the pairs with these two. */
function movedLeader(tracks, sources, pairs) {
  const leader = tracks.findIndex(({ leads }) => leads);
  if (leader < 0 || sources.length === 0) return { tracks, pairs };
  const ranks = sources.map((one) => strengthOf(one));
  const first = ranks.indexOf(Math.max(...ranks));
  const moved = { ...tracks[leader], place: begin(Float64Array.from(sources[first].direction)), turns: true };
  const others = [...pairs].filter(([at, j]) => at !== leader && j !== first);
  return { tracks: tracks.map((track, at) => (at === leader ? moved : track)), pairs: new Map([...others, [leader, first]]) };
}

/** Which of them is the leader; -1 where there are none. */
function leaderOf(tracks, isSame = false) {
  const ranks = tracks.map((track) => strengthOf(sourceOf(track), track.share));
  const most = Math.max(...ranks);
  const leader = tracks.findIndex(({ leads }, at) => leads && (isSame || most <= LEAD_RATIO * ranks[at]));
  return leader < 0 ? ranks.indexOf(most) : leader;
}

const ledBy = (leader, tracks) => tracks.map((track, at) => ({ ...track, leads: at === leader }));

/** Whether a frame shows another leader than the one that is known. */
function showsAnotherLeader(tracks, sources, pairs) {
  const at = tracks.findIndex(({ leads }) => leads);
  if (at < 0) return false;
  return !pairs.has(at) || Math.max(...sources.map((one) => strengthOf(one))) > LEAD_RATIO * strengthOf(sources[pairs.get(at)]);
}

/** Give the leader of others, in place, what it takes to be LEAD_MARGIN times as strong as each. */
function putFirst(sources, leader) {
  const scaled = (source, gain) => ({ ...source, power: source.power.map((value) => value * gain) });
  for (let at = 0; at < sources.length; at++) {
    const [mine, other] = [peakOf(sources[leader]), peakOf(sources[at])];
    if (at === leader || mine <= 0 || LEAD_MARGIN * other <= mine) continue;
    const given = (LEAD_MARGIN * other - mine) / (1 + LEAD_MARGIN);
    sources[at] = scaled(sources[at], 1 - given / other);
    sources[leader] = scaled(sources[leader], 1 + given / mine);
  }
}

/** Which source of the frame is which known one: indices of sources by those of tracks. */
function pairsOf(tracks, sources) {
  const costs = [];
  tracks.forEach((track, i) => {
    const was = sourceOf(track);
    const toward = directionOf(track);
    sources.forEach((source, j) => {
      const angle = angleOf(toward, source.direction) / GATE;
      const ratio = Math.abs(Math.log((luminance(...source.power) + OFFSET) / (luminance(...was.power) + OFFSET))) / LN_RATIO;
      if (angle <= 1 && ratio <= 1) costs.push([angle + ratio, i, j]);
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

/** A track with its whole power. */
function sourceOf({ size: { steady }, shown: direction }) {
  return { direction, power: [0, 1, 2].map((i) => Math.max(Math.exp(steady[i]) - OFFSET, 0)), radius: Math.exp(steady[3]) };
}

const sizeOf = ({ power, radius }) => Float64Array.of(...power.map((value) => Math.log(value + OFFSET)), Math.log(radius));

/** That of a track's place, which what is shown turns to. */
const directionOf = ({ place: { steady } }) => unit([...steady]);

function fresh(source, pose, share) {
  const [place, size] = [Float64Array.from(source.direction), sizeOf(source)];
  const recent = Float64Array.of(...place, ...size);
  return { place: begin(place), size: begin(size), recent, shown: source.direction, share, pose, turns: false, unseenS: 0, leads: false };
}

function seen(track, source, pose, dt, smoothing, isSame) {
  const view = Math.min(turnedBy(track.pose, pose) / VIEW_TURN, 1);
  const near = approach(track.place.steady, track.recent.subarray(0, 3), view);
  const like = approach(track.size.steady, track.recent.subarray(3), view);
  const slack = isSame ? Math.PI : Math.max(view * VIEW_SLACK, SLACK);
  const place = advance(track.place, Float64Array.from(source.direction), dt, distance, smoothing, near, slack);
  const size = advance(track.size, sizeOf(source), dt, distance, smoothing, like, view * VIEW_SLACK_SIZE);
  const newest = Float64Array.of(...place.fast, ...size.fast);
  const moves = place.motion > 0;
  const wanted = directionOf({ place });
  const angle = angleOf(track.shown, wanted);
  const turns = moves || track.turns;
  const mostTurn = isSame ? SAME_MOST_TURN : MOST_TURN;
  const turn = (turns ? mostTurn : mostTurn ** (1 - view) * VIEW_MOST_TURN ** view) * dt;
  const part = angle > 0 ? Math.min(1, turn / angle) : 1;
  return {
    place,
    size,
    recent: approach(track.recent, newest, gain(dt, Math.min(RECENT_S, place.ageS))),
    shown: unit(track.shown.map((from, axis) => from + part * (wanted[axis] - from))),
    share: Math.min(track.share + dt / FADE_S, 1),
    pose: moves ? pose : track.pose,
    turns: turns && turn < angle,
    unseenS: 0,
    leads: track.leads,
  };
}

/** One that is hardly shown yet gets less patience. */
function unseen(track, dt) {
  const unseenS = track.unseenS + dt;
  const fades = unseenS > PATIENCE_S * track.share;
  return { ...track, unseenS, share: Math.max(track.share - (fades ? dt / FADE_S : 0), 0) };
}

const distance = (a, b) => Math.sqrt(a.reduce((sum, value, i) => sum + (value - b[i]) ** 2, 0));

const angleOf = (a, b) => 2 * Math.asin(Math.min(distance(a, b) / 2, 1));

/** Angle between two poses. */
const turnedBy = (from, to) => Math.acos(Math.min(Math.max((from.reduce((sum, value, i) => sum + value * to[i], 0) - 1) / 2, -1), 1));

function unit(vector) {
  const length = Math.hypot(...vector);
  return vector.map((value) => value / length);
}

const turned = (m, [x, y, z]) => [0, 3, 6].map((row) => m[row] * x + m[row + 1] * y + m[row + 2] * z);

const transposed = ([a, b, c, d, e, f, g, h, i]) => [a, d, g, b, e, h, c, f, i];

function turn(map, rotation) {
  return rotate(map, MAP_HEIGHT, rotation).map((value) => Math.max(value, 0));
}

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
