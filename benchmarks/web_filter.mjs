// The npm package's filter over one run of maps, for flicker.py: node web_filter.mjs FOLDER SECONDS. FOLDER holds frames.f32,
// [T, 64, 128, 3] float32, and where the camera turns poses.f64, [T, 3, 3] world_from_camera; shown.f32 is written beside, in
// each frame's camera.

import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { shown, step } from "../web/src/light/temporal.js";

const [folder, seconds] = [process.argv[2], Number(process.argv[3])];
const numbers = (name, Kind) => {
  const { buffer, byteOffset, length } = readFileSync(join(folder, name));
  return new Kind(buffer.slice(byteOffset, byteOffset + length));
};
const frames = numbers("frames.f32", Float32Array);
const poses = existsSync(join(folder, "poses.f64")) ? numbers("poses.f64", Float64Array) : null;
const size = 64 * 128 * 3;
const maps = new Float32Array(frames.length);
let state = null;
for (let at = 0; at < frames.length; at += size) {
  const pose = poses && [...poses.subarray((9 * at) / size, (9 * at) / size + 9)];
  state = step(state, frames.subarray(at, at + size), seconds, pose);
  maps.set(shown(state, pose), at);
}
writeFileSync(join(folder, "shown.f32"), maps);
