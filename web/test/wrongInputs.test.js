/**
 * Wrong inputs on the page. WRONG_INPUTS names a file that tests/page/test_wrong_inputs.py writes: of each input the server's
 * answer, and, where the browser itself takes it, what Python says.
 */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { AnyProbe } from "../src/anyprobe.js";
import { OPTIONS } from "../src/checks.js";
import { errorLine, problemLine } from "../page/words.js";

const path = process.env.WRONG_INPUTS;
const skip = path ? false : "WRONG_INPUTS names no file of Python's answers";
const cases = path ? JSON.parse(readFileSync(path, "utf8")) : { "no input": {} };

/** What the page calls its controls, by options and by fields. */
const LABELS = { click: "click", exclude: "click", box: "box", pitchDeg: "“Camera pitch”", surroundings: "“Look at”" };
const FOREIGN = new RegExp(`--|\\b(${[...OPTIONS.estimate, "fov_deg", "pitch_deg"].join("|")})=|pitchDeg|longFovDeg|anyprobe `);

const bytesOf = (text) => Uint8Array.from(Buffer.from(text, "base64"));

/** A picture in memory, a file that is none, or what needs no reading. */
function opened(value) {
  if (value?.bytes !== undefined) return new Blob([bytesOf(value.bytes)]);
  if (value?.rgba !== undefined) return { ...value, rgba: new Uint8ClampedArray(bytesOf(value.rgba)) };
  return value;
}

/** A mask as numbers; as a file where it is none. */
function maskOf(value) {
  const { width, height, rgba, bytes } = value;
  if (bytes !== undefined) return opened(value);
  const levels = bytesOf(rgba);
  return { width, height, data: Float32Array.from({ length: width * height }, (_, i) => levels[4 * i] / 255) };
}

/** A probe whose thread finds nothing. */
function openProbe() {
  globalThis.createImageBitmap = async () => {
    throw new Error("no picture");
  };
  const found = { mask: new Float32Array(1), quality: 0, warnings: [] };
  const client = { spares: [], check: () => {}, give: () => {}, ask: async (task) => (task === "mark" ? found : assert.fail("nothing was refused")) };
  return new AnyProbe(client, { hasMask: true, threads: 1 });
}

for (const [name, { problem, browser }] of Object.entries(cases)) {
  test(`${name}: the server's answer in the page's words`, { skip }, () => {
    const line = problemLine(problem);
    assert.ok(line.startsWith(problem.text) || line.endsWith(problem.text) || line.includes(`: ${problem.text}`), line);
    assert.doesNotMatch(line.replace(problem.text, ""), FOREIGN);
    for (const { do: kind, name: option } of problem.remedy ?? []) {
      if (kind === "give" && ["click", "box", "surroundings"].includes(option)) assert.ok(line.includes(LABELS[option]), line);
      if (kind === "run") assert.match(line, /choose a photo/);
    }
  });
  if (!browser) continue;
  test(`${name}: the browser's package and the page`, { skip }, async () => {
    const options = { ...browser.options };
    if (options.mask) options.mask = maskOf(options.mask);
    if (options.normals) options.normals = Float32Array.from(options.normals);
    const error = await openProbe().estimate(opened(browser.photo), options).then(() => assert.fail("nothing was refused"), (fault) => fault);
    assert.equal(error.code, browser.code, error.message);
    const subject = error.notice.subject.map((one) => one.split(".")[0]);
    if (!(options.mask === undefined && subject[0] === "image")) assert.deepEqual(subject.sort(), [...new Set(browser.subject)].sort(), error.message);
    const line = errorLine(error);
    assert.doesNotMatch(line, FOREIGN);
    for (const option of browser.subject) if (LABELS[option]) assert.ok(line.includes(LABELS[option]), line);
    if (browser.code === "no-object") for (const option of browser.remedy) if (option !== "mask") assert.ok(line.includes(LABELS[option]), line);
  });
}
