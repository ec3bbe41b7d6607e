/**
 * Masks as the page finds them: node bench/masks.js FOLDER
 *
 * FOLDER holds cases.json, {weights: {u2netp} or {mask}, cases: [{name, width, height, hints}]}, and NAME.rgba; every mask
 * is written as NAME.f32. Prints the milliseconds of processor time that each took: {NAME: ms}.
 */

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import * as ort from "onnxruntime-web";

import { Models } from "../src/networks/models.js";
import { SmallNetwork, U2NetP } from "../src/photo/maskNetworks.js";
import { findObject, maskOf } from "../src/photo/search.js";

const folder = process.argv[2];
const { weights, cases } = JSON.parse(readFileSync(join(folder, "cases.json")));
ort.env.wasm.numThreads = 1;
const [[stage, path]] = Object.entries(weights);
const session = await ort.InferenceSession.create(new Uint8Array(readFileSync(path)));
const models = new Models(ort, { [stage]: session }, "wasm");
const network = models.hasU2netp ? new U2NetP(models) : new SmallNetwork(models);

const used = () => {
  const { user, system } = process.cpuUsage();
  return (user + system) / 1000;
};

const spent = {};
for (const { name, width, height, hints } of cases) {
  const picture = { width, height, rgba: new Uint8ClampedArray(readFileSync(join(folder, `${name}.rgba`))) };
  const start = used();
  const found = await findObject(network, picture, hints);
  const mask = found ? maskOf(found, width, height) : new Float32Array(width * height);
  spent[name] = used() - start;
  writeFileSync(join(folder, `${name}.f32`), mask);
}
console.log(JSON.stringify(spent));
