/** The examples as their readers start them: Vite's development server gives them the package, which lies above. */

import assert from "node:assert/strict";
import { readdirSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { isFileServingAllowed, resolveConfig } from "vite";

const examples = new URL("../examples/", import.meta.url);
const names = readdirSync(examples).filter((name) => name !== "public");

test("a development server serves the package's worker and the runtime", async () => {
  assert.equal(names.length, 4);
  for (const name of names) {
    const config = await resolveConfig({ root: fileURLToPath(new URL(name, examples)), logLevel: "silent" }, "serve");
    for (const file of ["../src/networks/wasmWorker.js", "../node_modules/onnxruntime-web/dist/ort-wasm-simd-threaded.wasm"]) {
      const path = fileURLToPath(new URL(file, import.meta.url));
      assert.ok(isFileServingAllowed(config, `/@fs${path}`), `${name}: ${file}`);
    }
  }
});
