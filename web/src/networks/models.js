/**
 * The networks of anyprobe through onnxruntime-web, as anyprobe.estimate.runtime runs them: one graph from a picture to its
 * light, or one that finds masks.
 */

import { AnyProbeError } from "../errors.js";
import { download } from "../files/download.js";
import { INPUTS } from "./lightGraph.js";

export class Models {
  /** @param {object} ort the runtime's module @param {Record<string, object>} sessions open sessions by stage: "light", "mask", "u2netp" */
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

  /**
   * Run a graph of masks: "mask", the small network, [4, 160, 160] letterboxed display RGB and hints to [160, 160] in [0, 1];
   * or "u2netp", [3, 320, 320] normalised as for ImageNet to [320, 320].
   *
   * @param {"mask" | "u2netp"} stage
   * @param {Float32Array} input
   * @param {number} size of its sides
   */
  async cover(stage, input, size) {
    const session = this.sessions[stage];
    const outputs = await session.run({ [session.inputNames[0]]: new this.ort.Tensor("float32", input, [1, input.length / size ** 2, size, size]) });
    return outputs[session.outputNames[0]].data;
  }
}

/** Bytes of a graph, fetched where its address is given. */
function graphOf(weights, onProgress) {
  if (weights instanceof Uint8Array) return weights;
  return download(weights.url, { integrity: weights.integrity, onProgress });
}
