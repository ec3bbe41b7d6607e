/** Say in one line what npm pack is missing: the packages that build the worker, or the clone that the weights are copied from. */

import { existsSync } from "node:fs";
import { fileURLToPath } from "node:url";

const isThere = (path) => existsSync(fileURLToPath(new URL(path, import.meta.url)));

function missing() {
  if (!isThere("../../src/anyprobe/weights")) return "expected a clone of anyprobe around web/, whose weights it copies, got web/ alone; run it in a clone";
  if (!isThere("../node_modules/vite")) return "expected the packages of web/, got none; run npm ci first";
  return null;
}

const why = missing();
if (why) {
  console.error(`npm pack: ${why}`);
  process.exit(1);
}
