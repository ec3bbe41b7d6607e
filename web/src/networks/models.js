/**
 * The networks of anyprobe through onnxruntime-web, as anyprobe.estimate.runtime runs them.
 *
 * A model is one graph that lifts pixels to the map, or the paper's chain of three; the mask
 * networks are optional, and opened when they are first wanted.
 */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { download } from "../files/download.js";
import { CONTEXT_SIZE, CROP_SIZE, NORMALS_SIZE } from "../photo/crop.js";
import { MAP_HEIGHT } from "../core/latlong.js";
import { response } from "../core/response.js";
import { LN_MAX, reconstruct } from "../light/reconstruct.js";

/** Sides of the squares that the mask networks see. */
const MASK_SIZE = CONTRACT.mask.small.size;
const U2NETP_SIZE = CONTRACT.mask.u2netp.size;

/** In NHWC, its default, ONNX Runtime 1.30 on WebGPU gets 3x3 convolutions wrong of 6, 9, 15, 18... input channels. */
const PROVIDERS = { wasm: "wasm", webgpu: { name: "webgpu", preferredLayout: "NCHW" } };

const MASKS = ["mask", "u2netp"];
const LIFT = ["light"];
/** Beside it, where there is one: completes its answer by what the picture shows around the object. */
const WHOLE = "whole";
const CHAIN = CONTRACT.graph.chain;
/** What the graphs of the light take, by stage. */
const INPUTS = { light: CONTRACT.graph.inputs, [WHOLE]: CONTRACT.graph.whole.inputs };
const PHOTO_SHAPE = [1, 4, CROP_SIZE, CROP_SIZE];
const NORMALS_SHAPE = [1, 3, NORMALS_SIZE, NORMALS_SIZE];
/** Zero: no normals are given. */
const NO_NORMALS = new Float32Array(3 * NORMALS_SIZE * NORMALS_SIZE);
const MAP_SHAPE = [1, 4, MAP_HEIGHT, 2 * MAP_HEIGHT];
/** Zero: nothing of the map is given. */
const NO_SURROUNDINGS = new Float32Array(8 * MAP_HEIGHT * MAP_HEIGHT);

/** Zero: the object's material is not given. */
const NO_MATERIAL = new Float32Array(CONTRACT.materials.inputs);

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
    const isChain = CHAIN.some((stage) => weights[stage]); // none: masks alone
    const stages = weights.light ? [...LIFT, ...(weights[WHOLE] ? [WHOLE] : [])] : isChain ? CHAIN : [];
    for (const stage of stages) {
      if (!weights[stage]) throw new AnyProbeError("invalid-option", `expected its address, got none`, { subject: [`weights.${stage}`] });
      sessions[stage] = await openStage(stage);
      const { inputNames } = sessions[stage];
      if (INPUTS[stage]?.every((name) => inputNames.includes(name)) ?? true) continue;
      throw new AnyProbeError("invalid-option", `expected a graph of ${INPUTS[stage].join(", ")}, got one of ${inputNames.join(", ")}`, { subject: [`weights.${stage}`] });
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

  /**
   * Run the model on a crop.
   *
   * @param {Float32Array} image [4, 128, 128] display RGB times mask, and mask
   * @param {number} tanHalf tangent of half the angle that the crop's side takes in
   * @param {object} [options] the paper's chain takes none of them but withStages
   * @param {boolean} [options.withStages] else only radiance and confidence are returned
   * @param {Float32Array | null} [options.surroundings] [4, 64, 128] what is seen of the map, in the crop's frame
   * @param {"mode" | "expected"} [options.emitters] light sources at their most likely positions (sharp shadows), or their
   *   mean radiance (soft)
   * @param {Float32Array | null} [options.normals] [3, 64, 64] given ones in the crop's frame, unit, zero where unknown
   * @param {Float32Array | null} [options.material] [8] of materialInput
   * @param {Float32Array | null} [options.context] [5, 96, 96] of contextOf
   * @param {number[] | null} [options.up] [3] away from the ground in the crop's frame, where it is known
   * @returns {Promise<{radiance: Float32Array, confidence: Float32Array | null, irradiance: Float32Array,
   *   ldr: Float32Array, lnRadiance: Float32Array}>} row by row, channel last: maps [64, 128, 3] in the crop's frame,
   *   irradiance [128, 128, 3] in [0, 1], confidence [64, 128] in [0, 1], null from the paper's chain; with stages also
   *   expected [64, 128, 3], light sources spread over all places where they may be
   */
  async light(image, tanHalf, options = {}) {
    return this.lifts ? this.#lift(image, tanHalf, options) : this.#chain(image, tanHalf);
  }

  /** Whether it takes surroundings and normals, and gives confidence and both kinds of light sources. */
  get lifts() {
    return "light" in this.sessions;
  }

  /** Whether it completes its answer by what the picture shows around the object. */
  get completes() {
    return WHOLE in this.sessions;
  }

  async #lift(image, tanHalf, options) {
    const { withStages = true, surroundings = null, emitters = "mode", normals = null, material = null } = options;
    let outputs = await this.#runByName("light", {
      photo: [image, PHOTO_SHAPE],
      tan_half: [Float32Array.of(tanHalf), [1, 1]],
      given_normals: [normals ?? NO_NORMALS, NORMALS_SHAPE],
      surroundings: [surroundings ?? NO_SURROUNDINGS, MAP_SHAPE],
      material: [material ?? NO_MATERIAL, [1, NO_MATERIAL.length]],
    });
    const said = readPosterior(outputs.posterior);
    if (options.context && this.completes) outputs = await this.#complete(outputs, tanHalf, options);
    const lnRadiance = channelLast(emitters === "expected" ? outputs.ln_expected : outputs.ln_radiance);
    const radiance = exponentials(lnRadiance);
    const { confidence, posture = null } = outputs;
    if (!withStages) return { radiance, confidence, posture, ...said };
    const irradiance = clipped(channelLast(outputs.irradiance));
    const expected = exponentials(channelLast(outputs.ln_expected));
    return { radiance, expected, confidence, irradiance, ldr: radiance.map((x) => response(x)), lnRadiance, posture, ...said };
  }

  /** The first graph's answer with what lies around the object. */
  async #complete(alone, tanHalf, { surroundings, context, up }) {
    const [ln, one] = [[1, 3, MAP_HEIGHT, 2 * MAP_HEIGHT], [1, 1, MAP_HEIGHT, 2 * MAP_HEIGHT]];
    const [radiance, expected, confidence, posture] = await this.#run(
      WHOLE,
      [context, [1, 5, CONTEXT_SIZE, CONTEXT_SIZE]],
      [Float32Array.of(tanHalf), [1, 1]],
      [alone.ln_expected, ln],
      [alone.ln_radiance, ln],
      [alone.confidence, one],
      [alone.posterior, [1, alone.posterior.length]],
      [surroundings ?? NO_SURROUNDINGS, MAP_SHAPE],
      [Float32Array.from(up ?? [0, 0, 0]), [1, 3]],
    );
    return { ...alone, ln_radiance: radiance, ln_expected: expected, confidence, posture };
  }

  async #chain(image, tanHalf) {
    const angle = [Float32Array.of(tanHalf), [1, 1]];
    const [irradiance] = await this.#run("irradiance", [image, PHOTO_SHAPE], angle);
    const plane = CROP_SIZE * CROP_SIZE;
    const withMask = new Float32Array(4 * plane);
    withMask.set(irradiance);
    withMask.set(image.subarray(3 * plane), 3 * plane);
    const [planes] = await this.#run("illumination", [withMask, PHOTO_SHAPE], angle);
    const [ln] = await this.#run("hdr", [planes, [1, 3, MAP_HEIGHT, 2 * MAP_HEIGHT]]);
    const [ldr, lnRadiance] = [channelLast(planes), channelLast(ln)];
    return { radiance: reconstruct(ldr, lnRadiance), confidence: null, irradiance: clipped(channelLast(irradiance)), ldr, lnRadiance };
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

  /** Values and shape of each input by name, to the values of each output. */
  async #runByName(stage, inputs) {
    const tensors = Object.entries(inputs).map(([name, of]) => [name, new this.ort.Tensor("float32", ...of)]);
    const outputs = await this.sessions[stage].run(Object.fromEntries(tensors));
    return Object.fromEntries(Object.entries(outputs).map(([name, { data }]) => [name, data]));
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

/** What the graph says of the object, and how far off its map is in two of three cases: stops and degrees. */
function readPosterior([metal, red, green, blue, reflectance, level, color]) {
  return {
    object: { metal, reflectance: [red, green, blue], reflectanceStops: reflectance / Math.LN2 },
    uncertainty: { levelStops: level / Math.LN2, colorDeg: color },
  };
}

const clipped = (values) => values.map((value) => Math.min(Math.max(value, 0), 1));

/** [3, H, W] to [H, W, 3]. */
function channelLast(values) {
  const plane = values.length / 3;
  const out = new Float32Array(values.length);
  for (let channel = 0, from = 0; channel < 3; channel++) {
    for (let to = channel; to < out.length; to += 3, from++) out[to] = values[from];
  }
  return out;
}

/** Radiance of its logarithm, bounded. */
function exponentials(ln) {
  const values = new Float32Array(ln.length);
  for (let i = 0; i < values.length; i++) values[i] = Math.exp(Math.min(ln[i], LN_MAX));
  return values;
}
