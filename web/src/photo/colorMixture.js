/** A mixture of Gaussians over display colours of 0 to 255: what an object's or its surroundings' colours are like. */

export const COMPONENTS = 5;

/** Added to the variances of a component that has none in some direction. */
const LEAST_VARIANCE = 0.01;
const SINGULAR = 1e-6;
/** What a component weighs below the largest by so much [nats] is not worth an exponential. */
const NEGLIGIBLE = 12;
const PAIRS = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];
/** Of a component: mean, inverse covariance by PAIRS, half the log of its determinant, that less the log of its share. */
const STRIDE = 11;

export class ColorMixture {
  #terms = new Float64Array(COMPONENTS * STRIDE);

  /** Learn from sums of colours (see ColorSums), one a component. */
  constructor(sums) {
    const total = sums.reduce((count, sum) => count + sum.count, 0);
    sums.forEach((sum, component) => this.#terms.set(gaussian(sum, total), component * STRIDE));
  }

  /** Which component, shares aside, a colour most probably comes from. */
  component(r, g, b) {
    let best = 0;
    let least = Infinity;
    for (let component = 0; component < COMPONENTS; component++) {
      const at = component * STRIDE;
      const cost = this.#halfDistance(at, r, g, b) + this.#terms[at + 9];
      if (cost < least) {
        best = component;
        least = cost;
      }
    }
    return best;
  }

  /** Minus the log of a colour's density, up to a constant that all mixtures share. */
  cost(r, g, b) {
    let least = Infinity;
    for (let component = 0, at = 0; component < COMPONENTS; component++, at += STRIDE) {
      COSTS[component] = this.#halfDistance(at, r, g, b) + this.#terms[at + 10];
      if (COSTS[component] < least) least = COSTS[component];
    }
    let sum = 0;
    for (let component = 0; component < COMPONENTS; component++) {
      const more = COSTS[component] - least;
      if (more < NEGLIGIBLE) sum += Math.exp(-more);
    }
    return least - Math.log(sum);
  }

  /** Half the squared Mahalanobis distance. */
  #halfDistance(at, r, g, b) {
    const t = this.#terms;
    const x = r - t[at];
    const y = g - t[at + 1];
    const z = b - t[at + 2];
    const diagonal = x * x * t[at + 3] + y * y * t[at + 6] + z * z * t[at + 8];
    return 0.5 * diagonal + x * y * t[at + 4] + x * z * t[at + 5] + y * z * t[at + 7];
  }
}

const COSTS = new Float64Array(COMPONENTS);

/** Number, sums and sums of products of colours. */
export class ColorSums {
  count = 0;
  sums = new Float64Array(9);

  add(r, g, b) {
    const s = this.sums;
    this.count += 1;
    s[0] += r;
    s[1] += g;
    s[2] += b;
    s[3] += r * r;
    s[4] += r * g;
    s[5] += r * b;
    s[6] += g * g;
    s[7] += g * b;
    s[8] += b * b;
  }

  get mean() {
    return [0, 1, 2].map((channel) => this.sums[channel] / this.count);
  }

  /** By PAIRS. */
  get covariance() {
    const { mean } = this;
    return PAIRS.map(([i, j], pair) => this.sums[3 + pair] / this.count - mean[i] * mean[j]);
  }
}

function gaussian(sum, total) {
  if (sum.count === 0) return new Float64Array(STRIDE).fill(Infinity, 9);
  let [a, b, c, d, e, f] = sum.covariance;
  const determinantOf = () => a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d);
  if (determinantOf() <= SINGULAR) {
    a += LEAST_VARIANCE;
    d += LEAST_VARIANCE;
    f += LEAST_VARIANCE;
  }
  const determinant = determinantOf();
  const adjugate = [d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b];
  const spread = 0.5 * Math.log(determinant);
  const inverse = adjugate.map((value) => value / determinant);
  return [...sum.mean, ...inverse, spread, spread - Math.log(sum.count / total)];
}

/**
 * Part colours into COMPONENTS clusters, where a mixture starts: the one that varies most is split across the
 * direction in which it does until there are enough (Orchard and Bouman 1991), as GrabCut's authors do.
 *
 * @param {Uint8Array} colors three a colour; sorted by cluster afterwards
 * @returns {ColorSums[]} of each cluster; the last ones are empty where there are fewer colours
 */
export function cluster(colors) {
  const found = [variation(colors)];
  while (found.length < COMPONENTS) {
    const widest = found.reduce((a, b) => (b.variance > a.variance ? b : a));
    if (!(widest.variance > 0)) break;
    const middle = split(widest);
    found.splice(found.indexOf(widest), 1, ...[[0, middle], [middle]].map((span) => variation(widest.colors.subarray(...span))));
  }
  return Array.from({ length: COMPONENTS }, (_, i) => found[i]?.sums ?? new ColorSums());
}

/** Sums of colours, the axis along which they vary most, and how much, summed over them. */
function variation(colors) {
  const sums = new ColorSums();
  for (let at = 0; at < colors.length; at += 3) sums.add(colors[at], colors[at + 1], colors[at + 2]);
  const [a, b, c, d, e, f] = sums.covariance;
  let axis = [1, 1, 1];
  let length = 0;
  for (let round = 0; round < 32; round++) {
    const [x, y, z] = axis;
    axis = [a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z];
    length = Math.hypot(...axis);
    if (!(length > 0)) break;
    axis = axis.map((value) => value / length);
  }
  return { colors, sums, axis, variance: length * sums.count };
}

/** Sort colours in place by the side of their mean along their axis; where the second side begins. */
function split({ colors, sums: { mean }, axis: [x, y, z] }) {
  const middle = x * mean[0] + y * mean[1] + z * mean[2];
  let begin = 0;
  let end = colors.length;
  while (begin < end) {
    const [r, g, b] = [colors[begin], colors[begin + 1], colors[begin + 2]];
    if (x * r + y * g + z * b <= middle) begin += 3;
    else {
      end -= 3;
      colors.copyWithin(begin, end, end + 3);
      colors[end] = r;
      colors[end + 1] = g;
      colors[end + 2] = b;
    }
  }
  return begin;
}
