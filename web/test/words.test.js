/** What package and server say is said on the page in its own words. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { AnyProbeError, receivedError, sentError } from "../src/errors.js";
import { untold } from "../page/view/maskQuality.js";
import { PAGE, errorLine, problemLine, sentence } from "../page/words.js";
import { PACKAGE, give, notice } from "../src/notices.js";
import { warningsOf } from "../src/photo/quality.js";

const leaveOut = (...names) => names.map((name) => ({ do: "leave out", name }));

test("a doubtful mask is a sentence of its own", () => {
  const part = new Uint8Array(320 * 320).fill(1, 0, 400);
  const [found] = warningsOf({ part, cover: new Float32Array(320 * 320).fill(0.6), agreed: 1, cut: 0 });
  assert.equal(found.code, "mask-doubtful");
  assert.equal(sentence(found), "The mask may be wrong: its outline is blurred.");
});

test("a doubt about a mask that was found is told beside the photo alone", () => {
  const [ofMask, ofLight] = [notice("mask-doubtful", "the mask may be wrong"), notice("pitch-unsure", "a guess")];
  assert.equal(untold({ quality: 0.6, notices: [ofMask] }, { notices: [ofLight] }), ofLight);
  assert.equal(untold({ quality: 0.6, notices: [ofMask] }, { notices: [] }), undefined);
  assert.equal(untold({ quality: null, notices: [ofMask] }, { notices: [ofLight] }), ofMask);
});

test("controls are called by their labels", () => {
  assert.equal(PAGE.line(notice("pitch-unsure", "a guess", give("pitchDeg"))), "a guess; set “Camera pitch”");
  const backdrop = notice("plain-backdrop", "a backdrop", [{ do: "give", name: "surroundings", value: "photo" }]);
  assert.equal(PAGE.line(backdrop), "a backdrop; choose “the whole photo” at “Look at”");
  assert.equal(PAGE.line(notice("mask-doubtful", "a mask", give("box", "click", "exclude", "mask"))), "a mask; draw a box around it, or click on the object");
});

test("a line in the package's words names its options", () => {
  assert.equal(PACKAGE.line(notice("a", "a guess", give("pitchDeg"))), "a guess; give pitchDeg");
  assert.equal(PACKAGE.line(notice("a", "a mask", give("box", "click", "mask"))), "a mask; give box, click or mask");
  assert.equal(PACKAGE.line(notice("a", "dark")), "dark");
  assert.equal(PACKAGE.line(notice("a", "two ways", [...give("mask"), ...leaveOut("box")])), "two ways; give mask, or leave out box");
});

test("what is wrong names options for programs and controls for users, across threads too", () => {
  const error = new AnyProbeError("invalid-option", "expected one of them, got both", { subject: ["box", "mask"], remedy: leaveOut("box", "mask") });
  assert.equal(error.message, "box and mask: expected one of them, got both; leave out box or mask");
  assert.equal(errorLine(error), "the box: expected one of them, got both");
  const again = receivedError(structuredClone(sentError(error)));
  assert.deepEqual([again.code, again.message, again.notice], [error.code, error.message, error.notice]);
  const unasked = new AnyProbeError("invalid-option", "found one colour", { remedy: leaveOut("surroundings") });
  assert.equal(errorLine(unasked), "found one colour; choose “automatic” at “Look at”");
  assert.equal(errorLine(new Error("anything else")), "anything else");
});

test("a file that is no photo gets no advice for the command line", () => {
  const problem = { detail: "photo: expected an image, got 9 bytes; check the path", text: "expected an image, got 9 bytes", subject: ["photo"] };
  const other = problemLine({ ...problem, remedy: [{ do: "run", name: "choose-photo" }] });
  assert.match(other, /^expected an image, got 9 bytes; choose a photo/);
  assert.doesNotMatch(other, /path/);
  const video = { detail: "", text: "expected an image, got a video", remedy: [{ do: "run", name: "use-video" }] };
  assert.match(problemLine(video), /^expected an image, got a video; .*use the camera/);
  assert.equal(problemLine({ detail: "all places are taken" }), "all places are taken");
});
