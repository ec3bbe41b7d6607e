/** anyprobe/webgpu for bundlers: the networks on WebGPU, whose runtime is another one. */

import { AnyProbe as Core } from "./anyprobe.js";
import { filesForWebgpu } from "./networks/webgpuFiles.js";

export * from "./exports.js";

export class AnyProbe extends Core {
  /** @param {import("../types/index.d.ts").LoadOptions} [options] */
  static load(options) {
    return super.load({ engine: "webgpu", ...options }, filesForWebgpu());
  }
}
