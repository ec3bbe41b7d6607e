/**
 * Masks as the page finds them: node bench/masks.js FOLDER
 *
 * FOLDER holds cases.json, {weights, cases: [{name, width, height, hints}]}, and NAME.rgba; every mask is written as
 * NAME.f32. Prints the milliseconds of processor time that each took: {NAME: {propose, cut}}.
 */

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import * as ort from "onnxruntime-web";

import { Models } from "../src/networks/models.js";
import { cutOut, cutOutOfBox } from "../src/photo/cutOut.js";
import { propose } from "../src/photo/propose.js";

const folder = process.argv[2];
const { weights, cases } = JSON.parse(readFileSync(join(folder, "cases.json")));
ort.env.wasm.numThreads = 1;
const session = await ort.InferenceSession.create(new Uint8Array(readFileSync(weights)));
const models = new Models(ort, { mask: session }, "wasm");

const used = () => {
  const { user, system } = process.cpuUsage();
  return (user + system) / 1000;
};

const spent = {};
for (const { name, width, height, hints } of cases) {
  const picture = { width, height, rgba: new Uint8ClampedArray(readFileSync(join(folder, `${name}.rgba`))) };
  const start = used();
  const cover = hints.box ? null : await propose((input) => models.mask(input), picture, hints);
  const proposed = used();
  const mask = cover ? cutOut(picture, cover, hints) : cutOutOfBox(picture, hints);
  spent[name] = { propose: proposed - start, cut: used() - proposed };
  writeFileSync(join(folder, `${name}.f32`), mask);
}
console.log(JSON.stringify(spent));
