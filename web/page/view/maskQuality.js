/** Say beside the photo whether the mask can be trusted. */

import { DOUBTFUL } from "../../src/photo/quality.js";
import { sentence } from "../words.js";
import { element } from "./elements.js";

/**
 * @param {{quality: number | null, notices: import("../../src/notices.js").Notice[]} | null} found null hides it, as does a mask
 *   that was given
 */
export function showQuality(found) {
  const quality = found?.quality ?? null;
  const line = element("mask-quality");
  line.hidden = quality === null;
  if (line.hidden) return;
  const [doubt] = found.notices;
  const isGood = quality >= DOUBTFUL && !doubt;
  line.textContent = doubt ? sentence(doubt) : `The mask ${isGood ? "looks right" : "may be wrong"}.`;
  line.className = isGood ? "good" : "warning";
}

/** The first doubt about mask and light that this line does not state. */
export const untold = (found, light) => [...(found.quality === null ? found.notices : []), ...light.notices][0];
