/** The networks' thread in one file, as text that anyprobe/core starts it from: npm run worker. */

import { mkdirSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { build } from "vite";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));

const { output } = await build({
  root: at(".."),
  configFile: false,
  logLevel: "warn",
  build: { write: false, target: "es2022", rolldownOptions: { input: at("../src/networks/worker.js") } },
});
if (output.length !== 1) throw new Error(`the worker: expected one file, got ${output.map(({ fileName }) => fileName)}`);
mkdirSync(at("../dist"), { recursive: true });
const head = "/** src/networks/worker.js in one file, written by build/worker.js. */\n\n";
writeFileSync(at("../dist/workerSource.js"), `${head}export default ${JSON.stringify(output[0].code)};\n`);
