/**
 * What vite leaves to do: the runtime of the networks and the example beside the page, large files
 * packed, and the digest of the sources that tests/rules/test_page.py compares.
 */

import { copyFileSync, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { constants, gzipSync } from "node:zlib";
import { sourceDigest } from "./digest.js";

const web = fileURLToPath(new URL("..", import.meta.url));
const page = join(web, "../src/anyprobe/serve/page");
const RUNTIME = ["ort.wasm.min.mjs", "ort-wasm-simd-threaded.mjs", "ort-wasm-simd-threaded.wasm"];
const BUNDLED = ["three", "onnxruntime-web", "swagger-ui-dist"];
const PACK_FROM_BYTES = 100_000;
const PACKED_KINDS = /\.(js|mjs|css|wasm)$/;

mkdirSync(join(page, "ort"), { recursive: true });
for (const name of RUNTIME) {
  copyFileSync(join(web, "node_modules/onnxruntime-web/dist", name), join(page, "ort", name));
}
const licences = BUNDLED.map((name) => `${name}\n\n${licenceOf(name)}`);
writeFileSync(join(page, "licences.txt"), licences.join("\n\n----\n\n"));
mkdirSync(join(page, "example"), { recursive: true });
copyFileSync(join(web, "../examples/table.png"), join(page, "example/table.png"));
mkdirSync(join(page, "photos"), { recursive: true });
copyFileSync(join(web, "../examples/teapot.jpg"), join(page, "photos/teapot.jpg"));

for (const name of readdirSync(page, { recursive: true })) {
  const path = join(page, name);
  if (!PACKED_KINDS.test(name) || statSync(path).size < PACK_FROM_BYTES) continue;
  writeFileSync(`${path}.gz`, gzipSync(readFileSync(path), { level: constants.Z_BEST_COMPRESSION }));
  rmSync(path);
}
writeFileSync(join(page, "source.txt"), `${sourceDigest(web)}\n`);

/** The licence of a package: its own file, else what its package.json says. */
function licenceOf(name) {
  const folder = join(web, "node_modules", name);
  const file = readdirSync(folder).find((entry) => /^licen[cs]e/i.test(entry));
  if (file) return readFileSync(join(folder, file), "utf8");
  const { license, author, homepage } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  return `${license}, ${author?.name ?? author ?? ""} ${homepage ?? ""}`;
}
