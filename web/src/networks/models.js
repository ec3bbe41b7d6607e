/**
 * The networks of anyprobe through onnxruntime-web.
 *
 * The three of the chain are those of anyprobe.infer.runtime; the mask network is optional.
 */

import { CROP_SIZE } from "../photo/crop.js";
import { MAP_HEIGHT } from "../core/latlong.js";

/** Side of the square that the mask network sees. */
export const MASK_SIZE = 160;

const CHAIN = ["irradiance", "illumination", "hdr"];

export class Models {
  /**
   * @param {object} ort the runtime's module
   * @param {Record<string, object>} sessions open sessions by stage
   * @param {string} provider what runs them: "webgpu" or "wasm"
   */
  constructor(ort, sessions, provider) {
    this.ort = ort;
    this.sessions = sessions;
    this.provider = provider;
  }

  /**
   * Open the chain, and the mask network where there is one.
   *
   * @param {object} ort
   * @param {Record<string, string | Uint8Array>} weights address or bytes of each graph
   * @param {{providers?: string[], onProgress?: (done: number, of: number) => void}} [options]
   */
  static async open(ort, weights, { providers = ["wasm"], onProgress = () => {} } = {}) {
    const stages = [...CHAIN, ...(weights.mask ? ["mask"] : [])];
    const sessions = {};
    for (const [index, stage] of stages.entries()) {
      onProgress(index, stages.length);
      sessions[stage] = await ort.InferenceSession.create(weights[stage], {
        executionProviders: providers,
        graphOptimizationLevel: "all",
      });
    }
    onProgress(stages.length, stages.length);
    return new Models(ort, sessions, providers[0]);
  }

  get hasMask() {
    return "mask" in this.sessions;
  }

  /**
   * Run the chain on a crop.
   *
   * @param {Float32Array} image [4, 128, 128] display RGB times mask, and mask
   * @returns {Promise<{irradiance: Float32Array, ldr: Float32Array, lnRadiance: Float32Array}>}
   *   row by row, channel last: [128, 128, 3] in [0, 1], [64, 128, 3], [64, 128, 3]
   */
  async light(image) {
    const irradiance = await this.#run("irradiance", image, [1, 4, CROP_SIZE, CROP_SIZE]);
    const plane = CROP_SIZE * CROP_SIZE;
    const withMask = new Float32Array(4 * plane);
    withMask.set(irradiance);
    withMask.set(image.subarray(3 * plane), 3 * plane);
    const ldr = await this.#run("illumination", withMask, [1, 4, CROP_SIZE, CROP_SIZE]);
    const lnRadiance = await this.#run("hdr", ldr, [1, 3, MAP_HEIGHT, 2 * MAP_HEIGHT]);
    return {
      irradiance: channelLast(irradiance).map((value) => Math.min(Math.max(value, 0), 1)),
      ldr: channelLast(ldr),
      lnRadiance: channelLast(lnRadiance),
    };
  }

  /**
   * Run the mask network.
   *
   * @param {Float32Array} input [4, 160, 160] letterboxed display RGB and hints
   * @returns {Promise<Float32Array>} [160, 160] in [0, 1]
   */
  mask(input) {
    return this.#run("mask", input, [1, 4, MASK_SIZE, MASK_SIZE]);
  }

  async #run(stage, values, shape) {
    const session = this.sessions[stage];
    const feeds = { [session.inputNames[0]]: new this.ort.Tensor("float32", values, shape) };
    const outputs = await session.run(feeds);
    return outputs[session.outputNames[0]].data;
  }
}

/** [3, H, W] to [H, W, 3]. */
function channelLast(values) {
  const plane = values.length / 3;
  const out = new Float32Array(values.length);
  for (let pixel = 0; pixel < plane; pixel++) {
    for (let channel = 0; channel < 3; channel++) out[3 * pixel + channel] = values[channel * plane + pixel];
  }
  return out;
}
