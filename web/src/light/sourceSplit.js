/**
 * Split a map into its soft part and a few discrete sources, by the rule of anyprobe.light.source_split.
 *
 * @typedef {{direction: number[], power: number[], radius: number}} Source unit vector towards it; integral of radiance over
 *   its pixels, sr; radians
 */

import { luminance } from "../core/color.js";
import { CONTRACT } from "../core/contract.js";
import { pixelDirections, pixelSolidAngles } from "../core/latlong.js";

const rules = CONTRACT.source_split;
const radians = (degrees) => (degrees * Math.PI) / 180;
/** Of compact and of wide sources: cosines of reach, ring and apart, and the largest radius. */
const COMPACT_AND_WIDE = [rules, rules.wide].map((scale) => {
  const [reach, ring, apart] = [scale.reach_deg, scale.ring_deg, scale.apart_deg].map((degrees) => Math.cos(radians(degrees)));
  return { reach, ring, apart, mostRadius: radians(scale.most_radius_deg) };
});
const LEAST_RADIUS = radians(rules.least_radius_deg);

/**
 * The map without its discrete sources, and the sources, the one with the brightest pixel first.
 *
 * @param {Float32Array} radiance H * 2H * 3
 * @param {number} height
 * @returns {{soft: Float32Array, sources: Source[]}}
 */
export function splitSources(radiance, height) {
  const width = 2 * height;
  const d = pixelDirections(height);
  const angles = pixelSolidAngles(height);
  const soft = radiance.slice();
  const bright = new Float32Array(height * width);
  let all = 0;
  for (let pixel = 0, at = 0; pixel < bright.length; pixel++, at += 3) {
    bright[pixel] = luminance(soft[at], soft[at + 1], soft[at + 2]);
    all += bright[pixel] * angles[Math.floor(pixel / width)];
  }
  const least = rules.least_share * all;
  const sources = [];
  for (let tried = 0; tried < rules.most; tried++) {
    let peak = 0;
    for (let pixel = 1; pixel < bright.length; pixel++) if (bright[pixel] > bright[peak]) peak = pixel;
    const first = [d[3 * peak], d[3 * peak + 1], d[3 * peak + 2]];
    let [center, apart] = [first, 0];
    for (const scale of COMPACT_AND_WIDE) {
      const found = sourceAround(soft, height, first, scale, least);
      if (found === null) return { soft, sources };
      [center, apart] = [found.direction, scale.apart];
      const { near, excess, power, radius } = found;
      if (radius > scale.mostRadius) continue;
      near.forEach((pixel, i) => {
        for (let c = 0; c < 3; c++) soft[3 * pixel + c] -= excess[3 * i + c];
      });
      sources.push({ direction: center, power, radius: Math.max(radius, LEAST_RADIUS) });
      break;
    }
    inCap(height, center, apart, (pixel) => (bright[pixel] = 0));
  }
  return { soft, sources };
}

/** What exceeds its surroundings around a place, as a source; null if its power is at most `least`. */
function sourceAround(soft, height, place, scale, least) {
  const width = 2 * height;
  const angles = pixelSolidAngles(height);
  let [direction, part] = [place, null];
  for (let round = 0; round < 2; round++) {
    part = above(soft, height, direction, scale);
    if (part.total <= least) return null;
    direction = unit(part.mean);
  }
  const { near, excess, total, power } = part;
  let squares = 0;
  near.forEach((pixel, i) => {
    const bright = luminance(excess[3 * i], excess[3 * i + 1], excess[3 * i + 2]);
    squares += bright * bright * angles[Math.floor(pixel / width)];
  });
  return { direction, near, excess, power, radius: Math.sqrt(((4 / (3 * Math.PI)) * total * total) / squares) };
}

/** What exceeds, around a direction, the median of the ring around it. */
function above(soft, height, center, { reach, ring: around }) {
  const width = 2 * height;
  const d = pixelDirections(height);
  const angles = pixelSolidAngles(height);
  const near = [];
  const ring = [];
  inCap(height, center, around, (pixel, cosine) => (cosine > reach ? near : ring).push(pixel));
  const level = [0, 1, 2].map((c) => Float32Array.from(ring, (pixel) => soft[3 * pixel + c]).sort()[(ring.length - 1) >> 1] ?? 0);
  const excess = new Float32Array(3 * near.length);
  const [mean, power] = [[0, 0, 0], [0, 0, 0]];
  let total = 0;
  near.forEach((pixel, i) => {
    const angle = angles[Math.floor(pixel / width)];
    for (let c = 0; c < 3; c++) {
      excess[3 * i + c] = Math.max(soft[3 * pixel + c] - level[c], 0);
      power[c] += excess[3 * i + c] * angle;
    }
    const energy = luminance(excess[3 * i], excess[3 * i + 1], excess[3 * i + 2]) * angle;
    total += energy;
    for (let axis = 0; axis < 3; axis++) mean[axis] += energy * d[3 * pixel + axis];
  });
  return { near, excess, mean, power, total };
}

/**
 * Add discs to a map, brightest in the middle, each with its source's power however few its pixels.
 *
 * @param {Float32Array} map H * 2H * 3
 * @param {number} height
 * @param {Source[]} sources
 */
export function drawSources(map, height, sources) {
  const angles = pixelSolidAngles(height);
  for (const { direction, power, radius } of sources) {
    const edge = Math.cos(radius);
    let total = 0;
    const disc = [];
    inCap(height, direction, edge, (pixel, cosine) => {
      disc.push([pixel, cosine - edge]);
      total += (cosine - edge) * angles[Math.floor(pixel / (2 * height))];
    });
    for (const [pixel, shape] of disc) for (let c = 0; c < 3; c++) map[3 * pixel + c] += (shape / total) * power[c];
  }
  return map;
}

/** Every pixel whose direction's cosine to another is above one, row by row. */
function inCap(height, direction, least, visit) {
  const d = pixelDirections(height);
  const width = 2 * height;
  const [x, y, z] = direction;
  const [polar, radius] = [Math.acos(Math.min(Math.max(direction[1], -1), 1)), Math.acos(least)];
  const rowOf = (theta) => Math.min(Math.max(Math.floor((theta * height) / Math.PI), 0), height - 1);
  for (let row = rowOf(polar - radius); row <= rowOf(polar + radius); row++) {
    for (let pixel = row * width; pixel < (row + 1) * width; pixel++) {
      const cosine = d[3 * pixel] * x + d[3 * pixel + 1] * y + d[3 * pixel + 2] * z;
      if (cosine > least) visit(pixel, cosine);
    }
  }
}

function unit(vector) {
  const length = Math.hypot(...vector);
  return vector.map((value) => value / length);
}
