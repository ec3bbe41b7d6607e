/** The numbers that Python and JavaScript share, as a module that any browser and bundler takes: npm run contract. */

import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));

const head = "/** The numbers that Python and JavaScript share: src/anyprobe/contract.json, written here by build/contract.js. */\n\n";
const contract = readFileSync(at("../../src/anyprobe/contract.json"), "utf8").trimEnd();
writeFileSync(at("../src/core/contract.js"), `${head}export const CONTRACT = ${contract};\n`);
