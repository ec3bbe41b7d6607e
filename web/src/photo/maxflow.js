/**
 * The minimal cut of a grid of pixels: Boykov and Kolmogorov (PAMI 2004).
 *
 * Every pixel has an excess, positive what the source sends into it, negative what the sink draws from it, and
 * edges of equal capacity both ways to its eight neighbours. Two trees of edges that still carry something grow
 * from the pixels with excess of either sign; where they meet, flow goes along the path, and what it uses up falls
 * off the trees and is adopted by another parent or set free. What the edges carry stays when the excess is changed,
 * so that another cut of almost the same grid takes a fraction of the time (Kohli and Torr, ICCV 2005).
 */

/** Steps x, y to the neighbours; the step back is the next or the last in the list (its number ^ 1). */
export const STEPS = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]];

const [FREE, SOURCE, SINK] = [0, 1, 2];
/** Parents that are no step: the pixel's own excess, and none any more. */
const [ROOT, ORPHAN] = [8, 9];
const FAR = 0x7fffffff;

export class MaxFlow {
  #offsets;
  #tree;
  #parent;
  /** Steps to the root, as known at a time; what is older may be too small. */
  #distance;
  #knownAt;
  #time = 0;
  #active;
  #orphans;

  /**
   * @param {number} width of the grid. Its outermost pixels must have no edges and no excess
   * @param {number} height
   */
  constructor(width, height) {
    const count = width * height;
    this.#offsets = Int32Array.from(STEPS, ([x, y]) => y * width + x);
    this.#tree = new Uint8Array(count);
    this.#parent = new Uint8Array(count);
    this.#distance = new Int32Array(count);
    this.#knownAt = new Int32Array(count);
    this.#active = new Queue(count);
    this.#orphans = new Queue(count);
    /** What each edge still carries: 8 a pixel, in the order of STEPS. To be filled before the first cut. */
    this.left = new Float32Array(8 * count);
    /** To be filled before the first cut; before another, what has changed is added. */
    this.excess = new Float32Array(count);
  }

  /** Whether a pixel is on the source's side of the last cut. */
  isSource(pixel) {
    return this.#tree[pixel] === SOURCE;
  }

  /** Send all that can be sent from source to sink. */
  cut() {
    this.#plant();
    for (let pixel = this.#active.take(); pixel >= 0; pixel = this.#active.take()) {
      while (this.#tree[pixel] !== FREE) {
        const step = this.#grow(pixel);
        if (step < 0) break;
        this.#time += 1;
        if (this.#tree[pixel] === SOURCE) this.#send(pixel, step);
        else this.#send(pixel + this.#offsets[step], step ^ 1);
        for (let orphan = this.#orphans.take(); orphan >= 0; orphan = this.#orphans.take()) this.#adopt(orphan);
      }
    }
  }

  /** Every pixel with excess becomes a root. */
  #plant() {
    this.#time = 1;
    for (let pixel = 0; pixel < this.excess.length; pixel++) {
      const excess = this.excess[pixel];
      this.#tree[pixel] = excess > 0 ? SOURCE : excess < 0 ? SINK : FREE;
      if (excess === 0) continue;
      this.#parent[pixel] = ROOT;
      this.#distance[pixel] = 1;
      this.#knownAt[pixel] = 1;
      this.#active.add(pixel);
    }
  }

  /** Take in the free pixels around one; the step at which the other tree is met, or -1. */
  #grow(pixel) {
    const tree = this.#tree;
    const parent = this.#parent;
    const distance = this.#distance;
    const knownAt = this.#knownAt;
    const left = this.left;
    const own = tree[pixel];
    for (let step = 0; step < 8; step++) {
      const next = pixel + this.#offsets[step];
      if (!((own === SOURCE ? left[8 * pixel + step] : left[8 * next + (step ^ 1)]) > 0)) continue;
      if (tree[next] === FREE) {
        tree[next] = own;
        this.#active.add(next);
      } else if (tree[next] !== own) return step;
      else if (knownAt[next] > knownAt[pixel] || distance[next] <= distance[pixel]) continue;
      parent[next] = step ^ 1; // a free one's first parent, or one nearer to a root
      distance[next] = distance[pixel] + 1;
      knownAt[next] = knownAt[pixel];
    }
    return -1;
  }

  /** Send what the path through an edge carries, from the source's root to the sink's. */
  #send(from, step) {
    const parent = this.#parent;
    const left = this.left;
    const excess = this.excess;
    const offsets = this.#offsets;
    const to = from + offsets[step];
    let most = left[8 * from + step];
    let pixel = from;
    while (parent[pixel] !== ROOT) {
      const up = parent[pixel];
      pixel += offsets[up];
      most = Math.min(most, left[8 * pixel + (up ^ 1)]);
    }
    most = Math.min(most, excess[pixel]);
    pixel = to;
    while (parent[pixel] !== ROOT) {
      most = Math.min(most, left[8 * pixel + parent[pixel]]);
      pixel += offsets[parent[pixel]];
    }
    most = Math.min(most, -excess[pixel]);

    left[8 * from + step] -= most;
    left[8 * to + (step ^ 1)] += most;
    pixel = from;
    while (parent[pixel] !== ROOT) {
      const up = parent[pixel];
      const next = pixel + offsets[up];
      left[8 * pixel + up] += most;
      if ((left[8 * next + (up ^ 1)] -= most) === 0) this.#orphan(pixel);
      pixel = next;
    }
    if ((excess[pixel] -= most) === 0) this.#orphan(pixel);
    pixel = to;
    while (parent[pixel] !== ROOT) {
      const up = parent[pixel];
      const next = pixel + offsets[up];
      left[8 * next + (up ^ 1)] += most;
      if ((left[8 * pixel + up] -= most) === 0) this.#orphan(pixel);
      pixel = next;
    }
    if ((excess[pixel] += most) === 0) this.#orphan(pixel);
  }

  #orphan(pixel) {
    this.#parent[pixel] = ORPHAN;
    this.#orphans.add(pixel);
  }

  /** Give an orphan the parent nearest to a root of its tree, or set it free and its children too. */
  #adopt(orphan) {
    const tree = this.#tree;
    const parent = this.#parent;
    const left = this.left;
    const offsets = this.#offsets;
    const own = tree[orphan];
    const carries = (step, next) => (own === SOURCE ? left[8 * next + (step ^ 1)] : left[8 * orphan + step]) > 0;
    let best = ORPHAN;
    let least = FAR;
    for (let step = 0; step < 8; step++) {
      const next = orphan + offsets[step];
      if (tree[next] !== own || !carries(step, next)) continue;
      const distance = this.#distanceToRoot(next);
      if (distance < least) [best, least] = [step, distance];
    }
    if (best !== ORPHAN) {
      parent[orphan] = best;
      this.#distance[orphan] = least + 1;
      this.#knownAt[orphan] = this.#time;
      return;
    }
    tree[orphan] = FREE;
    for (let step = 0; step < 8; step++) {
      const next = orphan + offsets[step];
      if (tree[next] !== own) continue;
      if (carries(step, next)) this.#active.add(next);
      if (parent[next] === (step ^ 1)) this.#orphan(next);
    }
  }

  /** Of a pixel of a tree; FAR where an orphan is on the way. What was walked along is known from now on. */
  #distanceToRoot(start) {
    const parent = this.#parent;
    const distance = this.#distance;
    const knownAt = this.#knownAt;
    const offsets = this.#offsets;
    let steps = 0;
    let pixel = start;
    while (knownAt[pixel] !== this.#time && parent[pixel] < ROOT) {
      pixel += offsets[parent[pixel]];
      steps += 1;
    }
    if (parent[pixel] === ORPHAN) return FAR;
    if (knownAt[pixel] !== this.#time) {
      knownAt[pixel] = this.#time;
      distance[pixel] = 1;
    }
    const found = distance[pixel] + steps;
    for (let at = start, d = found; at !== pixel; at += offsets[parent[at]], d--) {
      knownAt[at] = this.#time;
      distance[at] = d;
    }
    return found;
  }
}

/** Pixels that wait, first in, first out, each once. */
class Queue {
  #waiting;
  #isIn;
  #first = 0;
  #length = 0;

  constructor(count) {
    this.#waiting = new Int32Array(count);
    this.#isIn = new Uint8Array(count);
  }

  add(pixel) {
    if (this.#isIn[pixel]) return;
    this.#isIn[pixel] = 1;
    const at = this.#first + this.#length++;
    this.#waiting[at < this.#waiting.length ? at : at - this.#waiting.length] = pixel;
  }

  /** The next one, or -1. */
  take() {
    if (this.#length === 0) return -1;
    const pixel = this.#waiting[this.#first++];
    if (this.#first === this.#waiting.length) this.#first = 0;
    this.#length -= 1;
    this.#isIn[pixel] = 0;
    return pixel;
  }
}
