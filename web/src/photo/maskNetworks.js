/**
 * The networks that find objects, as anyprobe.masks.networks: U2-Net-p, which has seen photos, and the small one, which
 * takes prompts.
 *
 * @typedef {object} Cover how likely each place of a picture is the object's
 * @property {Float32Array} values width * height in [0, 1], of the picture's extent
 * @property {number} width
 * @property {number} height
 */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { resize } from "./resize.js";

const { u2netp: U2NETP, small: SMALL } = CONTRACT.mask;

class Network {
  /** @param {import("../networks/models.js").Models} models */
  constructor(models) {
    this.models = models;
  }
}

/** What stands out in a picture, whatever the prompts. */
export class U2NetP extends Network {
  name = "u2netp";
  takesPrompts = false;

  /** @param {import("./picture.js").Picture} picture @returns {Promise<Cover>} 320 x 320 */
  async cover({ width, height, rgba }) {
    const { size, mean, spread } = U2NETP;
    const small = resize(rgba, 4, [width, height], [size, size]);
    const most = small.reduce((most, value, i) => (i % 4 < 3 ? Math.max(most, value) : most), 255e-6);
    const plane = size * size;
    const input = new Float32Array(3 * plane);
    for (let c = 0; c < 3; c++) {
      for (let i = 0; i < plane; i++) input[c * plane + i] = (small[4 * i + c] / most - mean[c]) / spread[c];
    }
    return { values: await this.models.cover("u2netp", input, size), width: size, height: size };
  }
}

/** Our own of 160 x 160, trained on renders alone; its fourth channel is the prompts. */
export class SmallNetwork extends Network {
  name = "small";
  takesPrompts = true;

  /** @param {import("./picture.js").Hints} hints in its pixels @returns {Promise<Cover>} the longer side 160 */
  async cover({ width, height, rgba }, { on, off, box }) {
    const { size, grey } = SMALL;
    const scale = size / Math.max(width, height);
    const [w, h] = [width, height].map((length) => Math.min(size, Math.max(1, Math.round(length * scale))));
    const [left, top] = [w, h].map((length) => Math.floor((size - length) / 2));
    const place = ([x, y]) => [left + (x * w) / width, top + (y * h) / height];
    const small = resize(rgba, 4, [width, height], [w, h]);
    const plane = size * size;
    const input = new Float32Array(4 * plane).fill(grey, 0, 3 * plane);
    for (let i = 0; i < w * h; i++) {
      const to = (top + Math.floor(i / w)) * size + left + (i % w);
      for (let c = 0; c < 3; c++) input[c * plane + to] = small[4 * i + c] / 255;
    }
    const corners = box && [...place(box.slice(0, 2)), ...place(box.slice(2))];
    input.set(drawPrompts(on.map(place), off.map(place), corners), 3 * plane);
    const answer = await this.models.cover("mask", input, size);
    const values = new Float32Array(w * h);
    for (let y = 0; y < h; y++) values.set(answer.subarray((top + y) * size + left, (top + y) * size + left + w), y * w);
    return { values, width: w, height: h };
  }
}

/**
 * A mask network that looks no more once what is looked for has been given up: what is asked next would wait for it.
 *
 * @param {SmallNetwork | U2NetP} network
 * @param {() => boolean} isGivenUp
 */
export function untilGivenUp(network, isGivenUp) {
  const cover = async (picture, hints) => {
    await new Promise((resolve) => setTimeout(resolve)); // to hear what has been sent meanwhile
    if (isGivenUp()) throw new AnyProbeError("failed", "The search has been given up.");
    return network.cover(picture, hints);
  };
  return { name: network.name, takesPrompts: network.takesPrompts, cover };
}

/** The prompt channel [160, 160], as anyprobe.masks.prompts.draw_prompts: box and clicks less clicks beside the object. */
export function drawPrompts(on, off, box = null) {
  const { size, box_level: level } = SMALL;
  const prompts = new Float32Array(size * size).map((_, i) => {
    const [x, y] = [(i % size) + 0.5, Math.floor(i / size) + 0.5];
    return box && x >= box[0] && x < box[2] && y >= box[1] && y < box[3] ? level : 0;
  });
  const against = drawBlobs(off, new Float32Array(prompts.length));
  return drawBlobs(on, prompts).map((value, i) => value - against[i]);
}

/** Raise values to a round blob of height 1 about each point. */
function drawBlobs(points, values) {
  const { size, click_sigma_px: sigma } = SMALL;
  const axis = (middle) => Float64Array.from({ length: size }, (_, i) => Math.exp(-0.5 * ((i + 0.5 - middle) / sigma) ** 2));
  for (const point of points) {
    const [across, down] = point.map(axis);
    for (let i = 0; i < values.length; i++) values[i] = Math.max(values[i], across[i % size] * down[Math.floor(i / size)]);
  }
  return values;
}
