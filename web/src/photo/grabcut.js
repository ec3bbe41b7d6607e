/**
 * GrabCut (Rother, Kolmogorov and Blake, SIGGRAPH 2004): a rough mask moved to where the colours say the object ends.
 *
 * Object and surroundings each have a mixture of five Gaussians of their colours; the cheapest cut is found between
 * pixels that look like one and pixels that look like the other, where a cut between like neighbours costs most;
 * then the mixtures are learnt anew. Energy and weights are OpenCV's.
 */

import { ColorMixture, ColorSums, COMPONENTS, cluster } from "./colorMixture.js";
import { MaxFlow, STEPS } from "./maxflow.js";

/** What is known of a pixel: 0 and 1 are sure, 2 and 3 perhaps; odd ones are the object. */
export const [OFF, ON, MAYBE_OFF, MAYBE_ON] = [0, 1, 2, 3];

/** Most that it costs to part two neighbours. */
const GAMMA = 50;

/**
 * @param {Uint8Array} rgb height * width * 3 display values
 * @param {number[]} size width, height
 * @param {Uint8Array} labels height * width; those that are not sure are changed, if some are odd and some even
 * @param {number} rounds
 */
export function grabCut(rgb, size, labels, rounds) {
  if (!labels.some((label) => label >= MAYBE_OFF) || !hasBothSides(labels)) return;
  const sides = [0, 1].map((side) => firstMixture(rgb, labels, side));
  const cut = new Cut(rgb, size, labels);
  for (let round = 0; round < rounds && hasBothSides(labels); round++) {
    learn(rgb, labels, sides);
    cut.run(labels, sides);
  }
}

function hasBothSides(labels) {
  return labels.some((label) => label % 2 === 0) && labels.some((label) => label % 2 === 1);
}

/** Of the surroundings (side 0) or the object (1), from clusters of their colours. */
function firstMixture(rgb, labels, side) {
  const colors = new Uint8Array(rgb.length);
  let end = 0;
  for (let pixel = 0; pixel < labels.length; pixel++) {
    if ((labels[pixel] & 1) !== side) continue;
    for (let at = 3 * pixel; at < 3 * pixel + 3; at++) colors[end++] = rgb[at];
  }
  return new ColorMixture(cluster(colors.subarray(0, end)));
}

/** The mixtures of both sides anew, each colour counted for the component of the last ones that it is likest. */
function learn(rgb, labels, sides) {
  const sums = Array.from({ length: 2 * COMPONENTS }, () => new ColorSums());
  for (let pixel = 0, at = 0; pixel < labels.length; pixel++, at += 3) {
    const side = labels[pixel] & 1;
    const component = sides[side].component(rgb[at], rgb[at + 1], rgb[at + 2]);
    sums[side * COMPONENTS + component].add(rgb[at], rgb[at + 1], rgb[at + 2]);
  }
  sides[0] = new ColorMixture(sums.slice(0, COMPONENTS));
  sides[1] = new ColorMixture(sums.slice(COMPONENTS));
}

/** The grid of the pixels that are not sure; a sure neighbour binds them as an excess. */
class Cut {
  constructor(rgb, [width, height], labels) {
    const [x0, y0, x1, y1] = boxOf(labels, width);
    this.rgb = rgb;
    this.columns = x1 - x0 + 2; // and a rim without edges
    this.flow = new MaxFlow(this.columns, y1 - y0 + 2);
    this.pixels = [];
    this.nodes = [];
    for (let y = y0; y < y1; y++) {
      for (let x = x0; x < x1; x++) {
        if (labels[y * width + x] < MAYBE_OFF) continue;
        this.pixels.push(y * width + x);
        this.nodes.push((y - y0 + 1) * this.columns + x - x0 + 1);
      }
    }
    this.costs = new Float32Array(this.pixels.length); // what the excess holds of the mixtures
    this.#tie(width, height, labels);
  }

  #tie(width, height, labels) {
    const { rgb, flow, pixels, nodes } = this;
    const mean = meanStep(rgb, width, height);
    const beta = mean > 0 ? 1 / (2 * mean) : 0;
    for (let step = 0; step < STEPS.length; step++) {
      const [dx, dy] = STEPS[step];
      const gamma = GAMMA / Math.hypot(dx, dy);
      for (let i = 0; i < pixels.length; i++) {
        const [x, y] = [(pixels[i] % width) + dx, Math.floor(pixels[i] / width) + dy];
        if (x < 0 || x >= width || y < 0 || y >= height) continue;
        const next = y * width + x;
        const tie = gamma * Math.exp(-beta * squaredStep(rgb, pixels[i], next));
        if (labels[next] >= MAYBE_OFF) flow.left[8 * nodes[i] + step] = tie;
        else flow.excess[nodes[i]] += labels[next] === ON ? tie : -tie;
      }
    }
  }

  /** Cut where it is cheapest, and tell the labels. */
  run(labels, [off, on]) {
    const { rgb, flow, pixels, nodes, costs } = this;
    for (let i = 0; i < pixels.length; i++) {
      const at = 3 * pixels[i];
      const [r, g, b] = [rgb[at], rgb[at + 1], rgb[at + 2]];
      const cost = off.cost(r, g, b) - on.cost(r, g, b);
      flow.excess[nodes[i]] += cost - costs[i];
      costs[i] = cost;
    }
    flow.cut();
    for (let i = 0; i < pixels.length; i++) labels[pixels[i]] = flow.isSource(nodes[i]) ? MAYBE_ON : MAYBE_OFF;
  }
}

/** Bounding box of the pixels that are not sure. */
function boxOf(labels, width) {
  let [x0, y0, x1, y1] = [Infinity, Infinity, 0, 0];
  labels.forEach((label, pixel) => {
    if (label < MAYBE_OFF) return;
    const [x, y] = [pixel % width, Math.floor(pixel / width)];
    [x0, x1] = [Math.min(x0, x), Math.max(x1, x + 1)];
    [y0, y1] = [Math.min(y0, y), Math.max(y1, y + 1)];
  });
  return [x0, y0, x1, y1];
}

/** Squared difference of neighbours, averaged over the picture. */
function meanStep(rgb, width, height) {
  let [sum, count] = [0, 0];
  for (let y = 0, pixel = 0; y < height; y++) {
    for (let x = 0; x < width; x++, pixel++) {
      for (const [dx, dy] of [[-1, 0], [-1, -1], [0, -1], [1, -1]]) {
        if (x + dx < 0 || x + dx >= width || y + dy < 0) continue;
        sum += squaredStep(rgb, pixel, pixel + dy * width + dx);
        count += 1;
      }
    }
  }
  return sum / count;
}

function squaredStep(rgb, a, b) {
  const [i, j] = [3 * a, 3 * b];
  return (rgb[i] - rgb[j]) ** 2 + (rgb[i + 1] - rgb[j + 1]) ** 2 + (rgb[i + 2] - rgb[j + 2]) ** 2;
}
