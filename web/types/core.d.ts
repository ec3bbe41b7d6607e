/** anyprobe/core: names no file of its own; weights and runtime are given. */

import type { AnyProbe as Any, LoadOptions } from "./index.d.ts";

export * from "./index.d.ts";

export type CoreLoadOptions = LoadOptions & Required<Pick<LoadOptions, "weights" | "runtime">>;

export interface AnyProbe extends Any {}
export declare const AnyProbe: {
  /** Open the networks in a thread of their own, whose script is text in this package unless `worker` is given. */
  load(options: CoreLoadOptions): Promise<AnyProbe>;
};
