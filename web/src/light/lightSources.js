/**
 * Light sources of a map: anyprobe.light.light_sources, where the rule stands.
 *
 * @typedef {object} LightSource
 * @property {number[]} direction unit vector towards it, in the map's frame
 * @property {number} radiusDeg of the even disc that spreads as much about the direction
 * @property {number[]} power integral of its radiance over its directions, sr
 * @property {number[]} irradiance on a plane that faces it
 * @property {number[]} color power over its largest channel
 * @property {number} exists probability that it is a source, and within 30 degrees of the direction
 * @property {number} errorDeg how far off the direction is at most in two of three maps that are estimates
 */

import { CONTRACT } from "../core/contract.js";
import { luminance } from "../core/color.js";
import { pixelDirections, pixelSolidAngles } from "../core/latlong.js";
import { blurCap } from "./filtering.js";

const RULES = CONTRACT.sources;
const ERROR = RULES.error;
const radians = (degrees) => (degrees * Math.PI) / 180;
/** Radius of the cap within which lobes are compared. */
export const BLUR_RADIUS = radians(RULES.blur_deg);
/** Cosine of the angle within which a source that the network said is the one found. */
const SAME = Math.cos(radians(RULES.most_radius_deg));

const source = (direction, radiusDeg, power, exists, errorDeg) => {
  const most = Math.max(...power);
  const facing = Math.cos(radians(radiusDeg) / 2) ** 2;
  const color = most > 0 ? power.map((value) => value / most) : [1, 1, 1];
  return { direction, radiusDeg, power, exists, errorDeg, irradiance: power.map((value) => value * facing), color };
};

/** The dominant light of a black or even map: WebXR's fallback. */
export const NO_SOURCE = source([0, 1, 0], 0, [0, 0, 0], 0, ERROR.most_deg);

/**
 * The dominant light of a map, and the other sources that are likely there; none of a black or even map.
 *
 * @param {Float32Array} radiance H * 2H * 3
 * @param {Float32Array | null} [said] of the network, `sources`
 * @returns {LightSource[]}
 */
export function findSources(radiance, height, said = null) {
  return [...lobesOf(radiance, height, said)].map(({ source }) => source).filter(({ exists }, i) => i === 0 || exists >= RULES.likely);
}

/** A map's sources that are likely there, and the rest, for renderers that are given both. */
export function splitSources(radiance, height) {
  return taken(radiance, [...lobesOf(radiance, height)].filter(({ source }) => source.exists >= RULES.likely));
}

/** A map's dominant light, as the only one of `sources`, and the rest. */
export function splitDominantLight(radiance, height) {
  const { value: main } = lobesOf(radiance, height).next();
  return taken(radiance, main ? [main] : []);
}

/** Take lobes, which do not overlap, out of a map. */
function taken(radiance, lobes) {
  const rest = radiance.slice();
  for (const { source: { power }, pixels, level } of lobes) {
    for (const pixel of pixels) {
      for (let c = 0; c < 3; c++) if (power[c] > 0) rest[3 * pixel + c] = Math.max(level[c], 0); // a channel without light stays whole
    }
  }
  return { rest, sources: lobes.map(({ source }) => source) };
}

/** The sources by falling peak, each with its pixels and the radiance beside them. */
function* lobesOf(radiance, height, said = null) {
  const width = 2 * height;
  const d = pixelDirections(height);
  const rowAngles = pixelSolidAngles(height);
  const angleOf = (pixel) => rowAngles[Math.floor(pixel / width)];
  const bright = new Float32Array(height * width);
  let total = 0;
  for (let pixel = 0, at = 0; pixel < bright.length; pixel++, at += 3) {
    bright[pixel] = luminance(radiance[at], radiance[at + 1], radiance[at + 2]);
    total += bright[pixel] * angleOf(pixel);
  }
  const left = blurCap(bright, height, 1, BLUR_RADIUS);
  const lit = new Uint8Array(bright.length);
  for (let count = 0; count < RULES.most; count++) {
    let peak = 0;
    for (let pixel = 1; pixel < left.length; pixel++) if (left[pixel] > left[peak]) peak = pixel;
    if (!(left[peak] > 0)) return;
    const level = RULES.lobe_level * left[peak];
    const lobe = connected(left.map((value) => (value >= level ? 1 : 0)), height, peak);
    const own = dilate(lobe, height);
    const ring = ringOf(own, height);
    const beside = ring.map((value, i) => (own[i] || lit[i] ? 0 : value));
    const found = measured(radiance, height, own, beside.includes(1) ? beside : own);
    if (found.length <= 1e-6 * total) return; // rounding alone, or light from all around: no direction
    ring.forEach((value, i) => value && (left[i] = 0));
    own.forEach((value, i) => value && (lit[i] = 1));
    let [inside, within] = [0, 0];
    lobe.forEach((value, i) => {
      inside += value * angleOf(i) * bright[i];
      within += value * angleOf(i);
    });
    const { direction, radiusDeg, power } = found;
    const contrast = inside / within / (luminance(...found.level) + 1e-9);
    const exists = likelihood(direction, said, luminance(...power) / total, contrast, radiusDeg);
    said = said?.map((value, at) => (at % 8 === 0 && isAt(direction, said, at) ? -1 : value)) ?? null; // it holds for one lobe
    const errorDeg = directionError(bright, height, direction);
    yield { source: source(direction, radiusDeg, power, exists, errorDeg), pixels: found.pixels, level: found.level };
  }

  /** Direction, size and power of what pixels have above the mean of those around. */
  function measured(map, rows, own, around) {
    const level = [0, 0, 0];
    let weight = 0;
    const pixels = [];
    for (let pixel = 0; pixel < own.length; pixel++) {
      if (own[pixel]) pixels.push(pixel);
      if (!around[pixel]) continue;
      weight += angleOf(pixel);
      for (let c = 0; c < 3; c++) level[c] += angleOf(pixel) * map[3 * pixel + c];
    }
    level.forEach((value, c) => (level[c] = value / weight));
    const [mean, power, excess] = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    let all = 0;
    for (const pixel of pixels) {
      const angle = angleOf(pixel);
      for (let c = 0; c < 3; c++) {
        excess[c] = map[3 * pixel + c] - level[c];
        power[c] += angle * excess[c];
      }
      const energy = Math.max(luminance(...excess), 0) * angle;
      all += energy;
      for (let axis = 0; axis < 3; axis++) mean[axis] += energy * d[3 * pixel + axis];
    }
    const length = Math.hypot(...mean);
    const radiusDeg = radiusOf(length / all, Math.PI / rows);
    return { level, pixels, length, direction: mean.map((value) => value / length), radiusDeg, power: power.map((value) => Math.max(value, 0)) };
  }
}

/** Degrees of an even disc of this mean cosine, less what pixels of this side spread; at least half of one. */
function radiusOf(cosine, pixel) {
  const beyond = Math.max(2 * (1 - cosine) - pixel ** 2 / 6, pixel ** 2 / 8);
  return (180 / Math.PI) * Math.acos(Math.max(1 - beyond, -1));
}

const isAt = ([x, y, z], said, at) => said[at + 1] * x + said[at + 2] * y + said[at + 3] * z > SAME;

/** How likely a lobe is a source: as the network says of one in its place, else by the rule. */
function likelihood(direction, said, share, contrast, radiusDeg) {
  let likely = -1;
  for (let at = 0; at < (said?.length ?? 0); at += 8) if (isAt(direction, said, at)) likely = Math.max(likely, said[at]);
  if (likely >= 0) return likely;
  const least = Math.min(share / RULES.least_share, contrast / RULES.least_contrast, RULES.most_radius_deg / radiusDeg);
  return least ** RULES.steep / (1 + least ** RULES.steep);
}

/**
 * Degrees by which a source's direction is off at most in two of three estimates: more, the further from it the map's light
 * comes. Bright places elsewhere make a direction doubtful, the dim rest of the map hardly.
 */
function directionError(bright, height, [x, y, z]) {
  const d = pixelDirections(height);
  const rowAngles = pixelSolidAngles(height);
  let [total, sum] = [0, 0];
  for (let pixel = 0; pixel < bright.length; pixel++) {
    const root = Math.sqrt(bright[pixel]); // powers are halves of whole numbers; ** takes ten times as long
    let weight = rowAngles[Math.floor(pixel / (2 * height))];
    for (let half = 0; half < 2 * ERROR.power; half++) weight *= root;
    const cosine = d[3 * pixel] * x + d[3 * pixel + 1] * y + d[3 * pixel + 2] * z;
    total += weight;
    sum += weight * Math.acos(Math.min(Math.max(cosine, -1), 1));
  }
  return Math.min(ERROR.factor * ((180 / Math.PI) * (sum / total) + ERROR.offset_deg) ** ERROR.exponent, ERROR.most_deg);
}

/** Visit the pixels that touch one on the sphere: in the row of a pole all do. */
function visitBeside(pixel, height, visit) {
  const width = 2 * height;
  const column = pixel % width;
  const line = pixel - column;
  visit(line + ((column + 1) % width));
  visit(line + ((column + width - 1) % width));
  if (line > 0) visit(pixel - width);
  if (line < (height - 1) * width) visit(pixel + width);
  if (line === 0 || line === (height - 1) * width) for (let other = line; other < line + width; other++) visit(other);
}

/** Grow a mask by the pixels beside it. */
function dilate(mask, height) {
  const grown = mask.slice();
  const add = (pixel) => (grown[pixel] = 1);
  mask.forEach((value, pixel) => value && visitBeside(pixel, height, add));
  return grown;
}

/** The part of a mask that is connected to one of its pixels on the sphere. */
function connected(mask, height, start) {
  const region = new Uint8Array(mask.length);
  const reached = [];
  const visit = (pixel) => {
    if (!mask[pixel] || region[pixel]) return;
    region[pixel] = 1;
    reached.push(pixel);
  };
  visit(start);
  for (const pixel of reached) visitBeside(pixel, height, visit);
  return region;
}

/** A mask grown by the pixels just outside. */
function ringOf(mask, height) {
  let grown = mask;
  for (let step = 0; step < RULES.ring_px; step++) grown = dilate(grown, height);
  return grown;
}

/** Cosine of the angle at which the drawn disc of a source ends; a smaller one may miss all pixels. */
export function edgeCosine({ radiusDeg }) {
  return Math.min(1.5 * Math.cos(radians(radiusDeg)) - 0.5, Math.cos(radians(RULES.least_edge_deg)));
}

/**
 * Discs, brightest in the middle, that spread as much as their sources and are of their power on any map; added to one.
 *
 * @param {Float32Array} map H * 2H * 3
 * @param {{direction: number[], power: number[], radiusDeg: number}[]} sources
 */
export function drawSources(map, height, sources) {
  const [d, angles] = [pixelDirections(height), pixelSolidAngles(height)];
  for (const one of sources) {
    const [x, y, z] = one.direction;
    const edge = edgeCosine(one);
    let total = 0;
    const disc = [];
    for (let pixel = 0; pixel < 2 * height * height; pixel++) {
      const beyond = d[3 * pixel] * x + d[3 * pixel + 1] * y + d[3 * pixel + 2] * z - edge;
      if (!(beyond > 0)) continue;
      disc.push([pixel, beyond]);
      total += beyond * angles[Math.floor(pixel / (2 * height))];
    }
    for (const [pixel, shape] of disc) for (let c = 0; c < 3; c++) map[3 * pixel + c] += (shape / total) * one.power[c];
  }
  return map;
}
