/** The graphs that the npm package carries, copied from the Python package, and their hashes: npm run weights. */

import { createHash } from "node:crypto";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));

/** Name in the package to the file in the repository. */
export const WEIGHTS = {
  light: at("../../src/anyprobe/weights/lift/light.onnx"),
  mask: at("../../src/anyprobe/weights/mask/mask.onnx"),
};

/** As browsers check it: Subresource Integrity. */
export const integrityOf = (path) => `sha384-${createHash("sha384").update(readFileSync(path)).digest("base64")}`;

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  mkdirSync(at("../weights"), { recursive: true });
  const lines = Object.entries(WEIGHTS).map(([name, path]) => {
    copyFileSync(path, at(`../weights/${name}.onnx`));
    return `  ${name}: "${integrityOf(path)}",\n`;
  });
  copyFileSync(at("../../LICENSE"), at("../LICENSE"));
  const head = "/** Hashes of the graphs in weights/, written by build/weights.js. */\n\n";
  writeFileSync(at("../src/networks/integrity.js"), `${head}export const INTEGRITY = {\n${lines.join("")}};\n`);
}
