/** anyprobe for bundlers: weights, worker and runtime are copied by what names them in networks/wasmFiles.js. */

import { AnyProbe as Core } from "./anyprobe.js";
import { filesForWasm } from "./networks/wasmFiles.js";

export * from "./exports.js";

export class AnyProbe extends Core {
  /** @param {import("../types/index.d.ts").LoadOptions} [options] */
  static load(options) {
    return super.load(options, filesForWasm());
  }
}
