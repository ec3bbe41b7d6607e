/**
 * The networks of anyprobe through onnxruntime-web, as anyprobe.estimate.runtime runs them: one graph from a picture to its
 * light, and mask networks, which are optional, and opened when they are first wanted.
 */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { download } from "../files/download.js";
import { INPUTS } from "./lightGraph.js";

/** Sides of the squares that the mask networks see. */
const MASK_SIZE = CONTRACT.mask.small.size;
const U2NETP_SIZE = CONTRACT.mask.u2netp.size;

/** In NHWC, its default, ONNX Runtime 1.30 on WebGPU gets 3x3 convolutions wrong of 6, 9, 15, 18... input channels. */
const PROVIDERS = { wasm: "wasm", webgpu: { name: "webgpu", preferredLayout: "NCHW" } };

const MASKS = ["mask", "u2netp"];
export class Models {
  #opening = {};

  /**
   * @param {object} ort the runtime's module
   * @param {Record<string, object>} sessions open sessions by stage
   * @param {string} provider what runs them: "webgpu" or "wasm"
   * @param {Record<string, () => Promise<object>>} [later] sessions by stage that are opened when they are first wanted
   */
  constructor(ort, sessions, provider, later = {}) {
    Object.assign(this, { ort, sessions, provider, later });
  }

  /**
   * Open a model; the mask networks, where there are any, when they are first wanted.
   *
   * @param {object} ort
   * @param {Record<string, {url: string, integrity?: string} | Uint8Array>} weights address of each graph, or its bytes
   * @param {{providers?: string[], onProgress?: (progress: import("../files/download.js").Progress) => void}} [options]
   */
  static async open(ort, weights, { providers = ["wasm"], onProgress = () => {} } = {}) {
    const openStage = async (stage) =>
      ort.InferenceSession.create(await graphOf(weights[stage], onProgress), {
        executionProviders: providers.map((name) => PROVIDERS[name]),
        graphOptimizationLevel: "all",
        extra: { session: { disable_quant_qdq: "1" } }, // small weights are widened once, not at each run
        logSeverityLevel: 3, // errors: it warns that shapes are computed on the processor, as they should be
      });
    const sessions = {};
    if (weights.light) { // else masks alone
      const { inputNames } = (sessions.light = await openStage("light"));
      if (!INPUTS.every((name) => inputNames.includes(name))) {
        throw new AnyProbeError("invalid-option", `expected a graph of ${INPUTS.join(", ")}, got one of ${inputNames.join(", ")}`, { subject: ["weights.light"] });
      }
    }
    const later = MASKS.filter((stage) => weights[stage]).map((stage) => [stage, () => openStage(stage)]);
    return new Models(ort, sessions, providers[0], Object.fromEntries(later));
  }

  get hasMask() {
    return "mask" in this.later || "mask" in this.sessions;
  }

  get hasU2netp() {
    return "u2netp" in this.later || "u2netp" in this.sessions;
  }

  /** Whether there is a light's graph, not masks' alone. */
  get hasLight() {
    return "light" in this.sessions;
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
   * Run the mask network.
   *
   * @param {Float32Array} input [4, 160, 160] letterboxed display RGB and hints
   * @returns {Promise<Float32Array>} [160, 160] in [0, 1]
   */
  async mask(input) {
    await this.openMask("mask");
    return (await this.#run("mask", [input, [1, 4, MASK_SIZE, MASK_SIZE]]))[0];
  }

  /**
   * Run U2-Net-p.
   *
   * @param {Float32Array} input [3, 320, 320] normalised as for ImageNet
   * @returns {Promise<Float32Array>} [320, 320] in [0, 1]
   */
  async u2netp(input) {
    await this.openMask("u2netp");
    return (await this.#run("u2netp", [input, [1, 3, U2NETP_SIZE, U2NETP_SIZE]]))[0];
  }

  /** Open a mask network, "mask" or "u2netp"; once, however often it is wanted. */
  async openMask(stage) {
    if (this.sessions[stage]) return;
    this.#opening[stage] ??= this.later[stage]().catch((error) => {
      delete this.#opening[stage]; // tried again when it is next wanted
      throw error;
    });
    this.sessions[stage] = await this.#opening[stage];
  }

  /** Values and shape of each input, to the values of each output, in the graph's order. */
  async #run(stage, ...inputs) {
    const session = this.sessions[stage];
    const tensors = inputs.map(([values, shape]) => new this.ort.Tensor("float32", values, shape));
    const feeds = Object.fromEntries(session.inputNames.map((name, i) => [name, tensors[i]]));
    const outputs = await session.run(feeds);
    return session.outputNames.map((name) => outputs[name].data);
  }
}

/** Bytes of a graph, fetched where its address is given. */
function graphOf(weights, onProgress) {
  if (weights instanceof Uint8Array) return weights;
  return download(weights.url, { integrity: weights.integrity, onProgress });
}
