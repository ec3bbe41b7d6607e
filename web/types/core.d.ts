/** anyprobe/core: names no file of its own; weights and runtime are given. */

import type { AnyProbe as Any, LightGraphs, LoadOptions, MaskGraphs } from "./index.js";

export * from "./index.js";

export type CoreLoadOptions = LoadOptions & Required<Pick<LoadOptions, "runtime">> & { weights: LightGraphs & MaskGraphs };

export interface AnyProbe extends Any {}
export declare const AnyProbe: {
  /** Open the networks in a thread of their own, whose script is text in this package unless `worker` is given. */
  load(options: CoreLoadOptions): Promise<AnyProbe>;
};
