/**
 * For the npm package, which has no contract.json beside it: write the numbers themselves into src/core/contract.js, as plain
 * JavaScript that every browser takes. `node build/contract.js restore` writes the import again.
 */

import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));
const HEAD =
  "/** The numbers that Python and JavaScript share; build/contract.js writes them into this file of the npm package. */\n\n";
const FROM = "../../../src/anyprobe/contract.json"; // of src/core

const text =
  process.argv[2] === "restore"
    ? `import contract from "${FROM}" with { type: "json" };\n\nexport const CONTRACT = contract;\n`
    : `export const CONTRACT = ${readFileSync(at("../../src/anyprobe/contract.json"), "utf8").trimEnd()};\n`;
writeFileSync(at("../src/core/contract.js"), HEAD + text);
