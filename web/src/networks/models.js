/**
 * The networks of anyprobe through onnxruntime-web, as anyprobe.estimate.runtime runs them: one graph from a picture to its
 * light, or one that finds masks.
 */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { download } from "../files/download.js";
import { INPUTS } from "./lightGraph.js";

/** Sides of the squares that the mask networks see. */
const MASK_SIZE = CONTRACT.mask.small.size;
const U2NETP_SIZE = CONTRACT.mask.u2netp.size;

export class Models {
  /**
   * @param {object} ort the runtime's module
   * @param {Record<string, object>} sessions open sessions by stage: "light", "mask", "u2netp"
   */
  constructor(ort, sessions) {
    Object.assign(this, { ort, sessions });
  }

  /**
   * Open what is given.
   *
   * @param {object} ort
   * @param {Record<string, {url: string, integrity?: string} | Uint8Array>} weights address of each graph, or its bytes
   * @param {{onProgress?: (progress: import("../files/download.js").Progress) => void}} [options]
   */
  static async open(ort, weights, { onProgress = () => {} } = {}) {
    const sessions = {};
    for (const [stage, graph] of Object.entries(weights)) {
      sessions[stage] = await ort.InferenceSession.create(await graphOf(graph, onProgress), {
        executionProviders: ["wasm"],
        graphOptimizationLevel: "all",
        extra: { session: { disable_quant_qdq: "1" } }, // small weights are widened once, not at each run
        logSeverityLevel: 3, // errors: it warns that shapes are computed on the processor, as they should be
      });
    }
    const { inputNames } = sessions.light ?? { inputNames: INPUTS };
    if (INPUTS.every((name) => inputNames.includes(name))) return new Models(ort, sessions);
    throw new AnyProbeError("invalid-option", `expected a graph of ${INPUTS.join(", ")}, got one of ${inputNames.join(", ")}`, { subject: ["weights.light"] });
  }

  /**
   * Run the light's graph.
   *
   * @param {Record<string, [Float32Array, number[]]>} inputs of graphInputs
   * @returns {Promise<Record<string, Float32Array>>} each output by name, as anyprobe.estimate.light_graph.Said has them
   */
  async light(inputs) {
    const tensors = Object.entries(inputs).map(([name, of]) => [name, new this.ort.Tensor("float32", ...of)]);
    const outputs = await this.sessions.light.run(Object.fromEntries(tensors));
    return Object.fromEntries(Object.entries(outputs).map(([name, { data }]) => [name, data]));
  }

  /** The small mask network: [4, 160, 160] letterboxed display RGB and hints to [160, 160] in [0, 1]. @param {Float32Array} input */
  mask(input) {
    return this.#run("mask", input, [1, 4, MASK_SIZE, MASK_SIZE]);
  }

  /** U2-Net-p: [3, 320, 320] normalised as for ImageNet to [320, 320] in [0, 1]. @param {Float32Array} input */
  u2netp(input) {
    return this.#run("u2netp", input, [1, 3, U2NETP_SIZE, U2NETP_SIZE]);
  }

  async #run(stage, input, shape) {
    const session = this.sessions[stage];
    const outputs = await session.run({ [session.inputNames[0]]: new this.ort.Tensor("float32", input, shape) });
    return outputs[session.outputNames[0]].data;
  }
}

/** Bytes of a graph, fetched where its address is given. */
function graphOf(weights, onProgress) {
  if (weights instanceof Uint8Array) return weights;
  return download(weights.url, { integrity: weights.integrity, onProgress });
}
