import assert from "node:assert/strict";
import { test } from "node:test";
import { groundDoubts } from "../src/photo/ground.js";

test("a camera that looks up is said to look up, not minus so many degrees down", () => {
  const said = (pitchDeg) => groundDoubts({ pitchDeg, pitchErrorDeg: 99, source: "estimated" })[0].text;
  assert.match(said(-5.2), /look 5 degrees up, /);
  assert.match(said(20.4), /look 20 degrees down, /);
  assert.match(said(-0.3), /look 0 degrees down, /);
});
