/** How good the mask is, below the picture in which it is corrected: in colour, and what looks wrong. */

import { DOUBTFUL } from "../../src/photo/quality.js";
import { sentence } from "../words.js";
import { element } from "./elements.js";

/** Below it most of the object is likely missed. */
const BAD = 0.5;

/** @param {{quality: number | null, notices: import("../../src/notices.js").Notice[]} | null} found null hides it, as does a mask that was given */
export function showQuality(found) {
  const quality = found?.quality ?? null;
  const line = element("mask-quality");
  line.hidden = quality === null;
  if (line.hidden) return;
  const [doubt] = found.notices;
  line.textContent = doubt ? sentence(doubt) : `Mask quality, estimated: ${quality.toFixed(2)}.`;
  line.className = quality >= DOUBTFUL ? "good" : quality >= BAD ? "warning" : "fault";
}
