/** Warn of objects that are mostly black or largely clipped, as anyprobe.estimate.doubts. */

import { CONTRACT } from "../core/contract.js";
import { luminance } from "../core/color.js";
import { notice } from "../notices.js";

const DOUBT = CONTRACT.exposure.doubt;

/** @returns {import("../notices.js").Notice[]} one where little can be estimated */
export function exposureDoubts({ width, height, rgba }, mask) {
  const step = Math.max(1, Math.floor(Math.sqrt(mask.reduce((sum, value) => sum + value, 0) / DOUBT.samples)));
  let [count, dark, clipped] = [0, 0, 0];
  for (let y = 0; y < height; y += step) {
    for (let x = 0; x < width; x += step) {
      const at = y * width + x;
      if (!(mask[at] > 0.5)) continue;
      const [red, green, blue] = [rgba[4 * at] / 255, rgba[4 * at + 1] / 255, rgba[4 * at + 2] / 255];
      count++;
      if (luminance(red, green, blue) <= DOUBT.dark) dark++;
      if (Math.min(red, green, blue) >= CONTRACT.curve.clipped) clipped++;
    }
  }
  const doubt = (code, share, what) => [notice(code, `${Math.round(100 * share)}% of the object is ${what}`)];
  if (count === 0) return [];
  if (dark / count >= DOUBT.dark_share) return doubt("object-dark", dark / count, "nearly black; little can be estimated from it; expose longer");
  if (clipped / count < DOUBT.clipped_share) return [];
  return doubt("object-clipped", clipped / count, "clipped; where its light comes from is uncertain; expose shorter");
}
