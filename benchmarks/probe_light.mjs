// Milliseconds of ProbeLight.update of anyprobe/three, what a page's own thread does for each light. Needs the packages of web/:
//
//     node benchmarks/probe_light.mjs [--updates 200]
//
// A map of 64 x 128 with a lamp that moves; with reflections, in a scene without a camera's place. Prints one JSON object: the
// median and the highest of all but the first twenty.

import { parseArgs } from "node:util";
import { ProbeLight } from "../web/src/three/index.js";
import { describe } from "../web/src/light/light.js";

const { values } = parseArgs({ options: { updates: { type: "string", default: "200" } } });
const [HEIGHT, WIDTH, UNCOUNTED] = [64, 128, 20];

/** A room of radiance 0.3 and a lamp of radiance 40, a few pixels wide. */
function mapOf(column) {
  const radiance = new Float32Array(HEIGHT * WIDTH * 3).fill(0.3);
  for (let y = 16; y < 20; y++) radiance.fill(40, 3 * (y * WIDTH + column), 3 * (y * WIDTH + column + 4));
  return radiance;
}

const light = new ProbeLight(null);
const ms = [];
for (let i = 0; i < Number(values.updates); i++) {
  const found = describe(mapOf(i % (WIDTH - 4)));
  const start = performance.now();
  light.update(found);
  ms.push(performance.now() - start);
}
const counted = ms.slice(UNCOUNTED).sort((a, b) => a - b);
console.log(JSON.stringify({ updates: ms.length, median_ms: +counted[counted.length >> 1].toFixed(2), highest_ms: +counted.at(-1).toFixed(2) }));
