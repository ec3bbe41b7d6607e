/**
 * Masks as the page finds them, and its lights: node bench/masks.js FOLDER
 *
 * FOLDER holds cases.json, {weights: {u2netp} or {mask}, and light, isLive, cases: [{name, width, height, hints}]}, and
 * NAME.rgba; every mask, of a live frame by one look of the small network, is written as NAME.f32. Prints {NAME: {ms, dominant}}:
 * processor time of the mask, and the dominant light where there is a light's graph.
 */

import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import * as ort from "onnxruntime-web";

import { describe } from "../src/light/light.js";
import { lightOfObject } from "../src/networks/lightOfObject.js";
import { Models } from "../src/networks/models.js";
import { DEFAULT_LONG_FOV_DEG } from "../src/photo/lens.js";
import { SmallNetwork, U2NetP } from "../src/photo/maskNetworks.js";
import { Looks, findObject, maskOf } from "../src/photo/search.js";

const folder = process.argv[2];
const { weights, isLive, cases } = JSON.parse(readFileSync(join(folder, "cases.json")));
ort.env.wasm.numThreads = 1;
const sessions = {};
for (const [stage, path] of Object.entries(weights)) sessions[stage] = await ort.InferenceSession.create(new Uint8Array(readFileSync(path)));
const models = new Models(ort, sessions, "wasm");
const network = sessions.u2netp ? new U2NetP(models) : new SmallNetwork(models);

const used = () => {
  const { user, system } = process.cpuUsage();
  return (user + system) / 1000;
};

const lightOf = async (picture, mask) => {
  const { dominant } = describe((await lightOfObject(models, picture, mask, DEFAULT_LONG_FOV_DEG, {})).radiance);
  return { direction: [...dominant.direction], irradiance: [...dominant.irradiance] };
};

const answers = {};
for (const { name, width, height, hints } of cases) {
  const picture = { width, height, rgba: new Uint8ClampedArray(readFileSync(join(folder, `${name}.rgba`))) };
  const start = used();
  const found = await findObject(new Looks(network, picture), hints);
  const mask = found ? maskOf(found, width, height) : new Float32Array(width * height);
  answers[name] = { ms: used() - start };
  if (sessions.light) answers[name].dominant = await lightOf(picture, mask);
  writeFileSync(join(folder, `${name}.f32`), mask);
}
console.log(JSON.stringify(answers));
