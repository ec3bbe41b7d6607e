/** What package and server say is said on the page in its own words. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { inPage, refusal } from "../page/inPage.js";
import { warningsOf } from "../src/photo/quality.js";

test("a doubtful mask has a quality, not an IoU", () => {
  const good = { agreed: 1, expected: 1, whole: 1, single: 1, meant: 1, border: 0, small: 0, large: 0 };
  const [line] = warningsOf({ ...good, expected: 0.6 }, 0.62);
  assert.equal(inPage(line), "The mask may be wrong (estimated quality 0.62: its outline is blurred).");
});

test("controls are called by their labels", () => {
  assert.equal(inPage("the pitch is a guess; give the pitch"), "the pitch is a guess; set “Camera pitch”");
  assert.equal(inPage('a backdrop, choose surroundings "photo"'), "a backdrop, choose “the whole photo” at “Look at”");
});

test("a file that is no photo is named, without advice for the command line", () => {
  const other = refusal("photo: expected an image, got 9 bytes of something else; check the path, or convert it", "notes.txt");
  assert.match(other, /^notes\.txt: this file is no picture\. Choose a photo/);
  assert.doesNotMatch(other, /path/);
  assert.match(refusal("photo: expected an image, got a video; anyprobe video takes it", "a.mp4"), /^a\.mp4: this file is a video\./);
  assert.equal(refusal("photo: expected an image, got a PDF document; export it", "a.pdf"), "a.pdf: expected an image, got a PDF document; export it");
});
