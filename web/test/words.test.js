/** What package and server say is said on the page in its own words. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { inPage, refusal, sentence } from "../page/words.js";
import { give, lineOf, notice } from "../src/notices.js";
import { warningsOf } from "../src/photo/quality.js";

test("a doubtful mask is a sentence of its own", () => {
  const good = { agreed: 1, expected: 1, whole: 1, single: 1, meant: 1, border: 0, small: 0, large: 0 };
  const [found] = warningsOf({ ...good, expected: 0.6 }, 0.62, []);
  assert.equal(found.code, "mask-doubtful");
  assert.equal(sentence(found), "The mask may be wrong: its outline is blurred.");
});

test("controls are called by their labels", () => {
  assert.equal(inPage(notice("pitch-unsure", "a guess", give("pitchDeg"))), "a guess; set “Camera pitch”");
  const backdrop = notice("plain-backdrop", "a backdrop", [{ do: "give", name: "surroundings", value: "photo" }]);
  assert.equal(inPage(backdrop), "a backdrop; choose “the whole photo” at “Look at”");
  assert.equal(inPage(notice("mask-doubtful", "a mask", give("box", "click", "exclude", "mask"))), "a mask; draw a box around it, or click on the object");
});

test("a line in the package's words names its options", () => {
  assert.equal(lineOf(notice("a", "a guess", give("pitchDeg"))), "a guess; give pitchDeg");
  assert.equal(lineOf(notice("a", "a mask", give("box", "click", "mask"))), "a mask; give box, click or mask");
  assert.equal(lineOf(notice("a", "dark")), "dark");
});

test("a file that is no photo is named, without advice for the command line", () => {
  const problem = { detail: "photo: expected an image, got 9 bytes; check the path", text: "expected an image, got 9 bytes" };
  const other = refusal({ ...problem, remedy: [{ do: "run", name: "choose-photo" }] }, "notes.txt");
  assert.match(other, /^notes\.txt: expected an image, got 9 bytes\. Choose a photo/);
  assert.doesNotMatch(other, /path/);
  const video = { detail: "", text: "expected an image, got a video", remedy: [{ do: "run", name: "use-video" }] };
  assert.match(refusal(video, "a.mp4"), /^a\.mp4: expected an image, got a video\. .*use the camera/);
  assert.equal(refusal({ detail: "all places are taken" }, "a.pdf"), "a.pdf: all places are taken");
});
