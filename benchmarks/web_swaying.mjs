// The npm package's lights of one clip, for swaying.py: node web_swaying.mjs CLIP WEIGHTS. CLIP holds clip.json and
// frames.rgb; WEIGHTS is a JSON object of graphs' files. Every frame goes through what the page's thread does with a camera's:
// luma and chroma, a picture of 480 pixels, the mask by the click, registration, networks, filter. Beside them are written
// web.f32, the lights [T, 64, 128, 3], web_single.f32, the same without the filter (NaN: no object was seen), and web_same.u8,
// whether the object looked the same; prints {ms}: processor time a frame after the first second, mean, and of each part.

import { closeSync, openSync, readFileSync, readSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { FrameLight } from "../web/src/live/frameLight.js";
import { Models } from "../web/src/networks/models.js";
import { videoMasks } from "../web/src/networks/masks.js";

const ort = createRequire(new URL("../web/package.json", import.meta.url))("onnxruntime-web");
const [folder, graphs] = [process.argv[2], JSON.parse(process.argv[3])];
const { width, height, fps, frames: count, click } = JSON.parse(readFileSync(join(folder, "clip.json"), "utf8"));
const SIZE = 64 * 128 * 3;

/** A camera's frame of luma and chroma, as videoFrames.js takes it. */
function frameOf(rgb) {
  const bytes = new Uint8Array(1.5 * width * height);
  const chroma = [new Float32Array((width * height) / 4), new Float32Array((width * height) / 4)];
  for (let i = 0; i < width * height; i++) {
    const [r, g, b] = [rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]];
    const y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    const at = (Math.floor(i / width) >> 1) * (width / 2) + ((i % width) >> 1);
    bytes[i] = Math.round(y);
    chroma[0][at] += (b - y) / 1.8556 / 4;
    chroma[1][at] += (r - y) / 1.5748 / 4;
  }
  chroma.forEach((plane, k) => plane.forEach((value, i) => (bytes[width * height * (1 + k / 4) + i] = Math.min(Math.max(Math.round(value + 128), 0), 255))));
  const layout = [0, 1, 2].map((k) => (k ? { offset: width * height * (1 + (k - 1) / 4), stride: width / 2 } : { offset: 0, stride: width }));
  return { width, height, format: "I420", layout, matrix: "bt709", fullRange: true, bytes };
}

ort.env.wasm.numThreads = 1;
const weights = Object.fromEntries(Object.entries(graphs).map(([name, path]) => [name, new Uint8Array(readFileSync(path))]));
const models = await Models.open(ort, weights);
const lights = new FrameLight(models, videoMasks(models), { on: [[click[0] / width, click[1] / height]], off: [], box: null }, 65, {}, false);
const [shown, raw] = [0, 1].map(() => new Float32Array(count * SIZE).fill(NaN));
const file = openSync(join(folder, "frames.rgb"));
const rgb = new Uint8Array(3 * width * height);
const ms = {};
let last = null;
const [masks, same] = [new Uint8Array(count), new Uint8Array(count)];
for (let at = 0; at < count; at++) {
  readSync(file, rgb, 0, rgb.length, at * rgb.length);
  const frame = frameOf(rgb);
  const before = process.cpuUsage();
  const answer = await lights.next(frame, at / fps);
  const { user, system } = process.cpuUsage(before);
  if (at >= fps) for (const [part, value] of Object.entries({ ...answer.ms, processor: (user + system) / 1000 })) ms[part] = (ms[part] ?? 0) + value / (count - fps);
  if (answer.light) [last, masks[at]] = [answer.light.radiance, 1];
  if (last) shown.set(last, at * SIZE);
  if (answer.light) raw.set(lights.single, at * SIZE);
  same[at] = Number(lights.object.looksSame);
}
closeSync(file);
writeFileSync(join(folder, "web.f32"), shown);
writeFileSync(join(folder, "web_single.f32"), raw);
writeFileSync(join(folder, "web_same.u8"), same);
console.log(JSON.stringify({ seen: masks.reduce((a, b) => a + b, 0), ms: Object.fromEntries(Object.entries(ms).map(([part, value]) => [part, Number(value.toFixed(1))])) }));
