/** Sizes of what a page loads, in kB (1000 bytes), as they are and by gzip: npm run sizes. */

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { build } from "vite";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));

/** A program of one line, bundled; what it does not use falls away. The .wasm, three.js and weights are others' rows. */
async function bundled(line) {
  const name = "\0program";
  const program = { name: "program", resolveId: (id) => (id === "program" ? name : null), load: (id) => (id === name ? line : null) };
  const { output } = await build({
    root: at(".."),
    configFile: false,
    logLevel: "silent",
    plugins: [program],
    worker: { format: "es" },
    build: { write: false, target: "es2022", rolldownOptions: { input: "program", external: ["three"] } },
  });
  return output.filter(({ fileName }) => fileName.endsWith(".js")).map((file) => Buffer.from(file.code ?? file.source));
}

const from = (path) => JSON.stringify(at(path));
const rows = {
  "anyprobe": await bundled(`import { AnyProbe } from ${from("../src/index.js")}; globalThis.a = AnyProbe;`),
  "anyprobe/core": await bundled(`import { AnyProbe } from ${from("../src/core.js")}; globalThis.a = AnyProbe;`),
  "anyprobe/three": await bundled(`import { ProbeLight } from ${from("../src/three/index.js")}; globalThis.a = ProbeLight;`),
  "installCameraCurve alone": await bundled(`import { installCameraCurve } from ${from("../src/three/index.js")}; globalThis.a = installCameraCurve;`),
  "encodeHdr alone": await bundled(`import { encodeHdr } from ${from("../src/core.js")}; globalThis.a = encodeHdr;`),
  "light.onnx": [readFileSync(at("../../src/anyprobe/weights/lift/light.onnx"))],
  "mask.onnx": [readFileSync(at("../../src/anyprobe/weights/mask/mask.onnx"))],
  "onnxruntime-web, WASM": ["ort-wasm-simd-threaded.mjs", "ort-wasm-simd-threaded.wasm"].map((name) => readFileSync(at(`../node_modules/onnxruntime-web/dist/${name}`))),
};
for (const [name, files] of Object.entries(rows)) {
  const [plain, packed] = [(bytes) => bytes.length, (bytes) => gzipSync(bytes, { level: 9 }).length].map((size) =>
    files.reduce((sum, bytes) => sum + size(bytes), 0),
  );
  console.log(`${name.padEnd(26)} ${(plain / 1000).toFixed(0).padStart(6)} kB  ${(packed / 1000).toFixed(0).padStart(6)} kB gzip`);
}
