/**
 * How good a found mask is, as anyprobe.masks.quality: what the network expects of it, and whether another look gives the
 * same object.
 */

import { CONTRACT } from "../core/contract.js";
import { boxOf, expectedOf } from "./search.js";
import { give, notice } from "../notices.js";

const { quality: QUALITY, search: NUMBERS } = CONTRACT.mask;
const { fits: FITS } = QUALITY;
const GRID = NUMBERS.grid;

/** Expected IoU below which a mask comes with a warning, and below which there is none. */
export const { doubtful: DOUBTFUL, refused: REFUSED } = QUALITY;

/**
 * Evidence about a mask, each from 0 to 1 where 1 is good, but of cut 0, by the names of anyprobe.masks.quality.Evidence.
 *
 * @param {import("./search.js").Finding} found
 * @param {import("./picture.js").Hints} hints by which it was found
 */
export function examine(found, hints) {
  const { agreed, whole, cut } = found;
  return { expected: expectedOf(found), agreed, whole, meant: fits(found, hints), cut };
}

function fits(found, { on, box }) {
  if (!box && !on.length) return FITS.unasked;
  return Math.min(box ? fitsBox(found, box) : 1, on.length ? fitsClicks(found, on) : 1);
}

function fitsBox({ window, part }, given) {
  const area = ([x0, y0, x1, y1]) => Math.max(x1 - x0, 0) * Math.max(y1 - y0, 0);
  const own = boxOf(window, part);
  const both = area(own.map((at, i) => (i < 2 ? Math.max : Math.min)(at, given[i])));
  return Math.min(1, both / (area(own) + area(given) - both) / FITS.box_iou);
}

/** Of two things that are taken for one, a click is rarely in the middle of both. */
function fitsClicks({ window, part }, on) {
  const away = [0, 1].map((axis) => {
    let [count, sum, squares] = [0, 0, 0];
    part.forEach((value, i) => {
      if (!value) return;
      const at = axis ? Math.floor(i / GRID) : i % GRID;
      [count, sum, squares] = [count + 1, sum + at, squares + at * at];
    });
    const click = on.reduce((total, point) => total + point[axis], 0) / on.length;
    const cell = ((click - window[axis]) * GRID) / (window[axis + 2] - window[axis]) - 0.5;
    return (cell - sum / count) / Math.max(Math.sqrt(squares / count - (sum / count) ** 2), 1);
  });
  return Math.max(0, 1 - Math.hypot(...away) / FITS.click_reach);
}

/** Expected IoU of a mask found by the network of that name. */
export function expectedIou(evidence, network) {
  const { offset, weights } = QUALITY[network];
  let odds = offset;
  for (const [name, weight] of Object.entries(weights)) odds += weight * evidence[name];
  return 1 / (1 + Math.exp(-odds));
}

/** The evidence that lowers the expected IoU most, in a few words. */
export function doubtOf(evidence, network, { on, box }) {
  const asked = [...(on.length ? ["click"] : []), ...(box ? ["box"] : [])];
  const words = {
    expected: "its outline is blurred",
    agreed: "a second look finds something else",
    whole: "other things stand out as well",
    meant: asked.length ? `it does not fit the ${asked.join(" or the ")}` : "it may not be what is meant",
    cut: "the box cuts it off, and should be around all of it",
  };
  const lost = ([name, weight]) => weight * (QUALITY.usual[name] - evidence[name]);
  const [[name]] = Object.entries(QUALITY[network].weights).sort((a, b) => lost(b) - lost(a));
  return words[name];
}

/**
 * A line about what looks wrong if the expected IoU is low.
 *
 * @param {ReturnType<typeof examine>} evidence
 * @param {string} network
 * @param {import("./picture.js").Hints} hints
 * @returns {import("../notices.js").Notice[]}
 */
export function warningsOf(evidence, network, hints) {
  if (expectedIou(evidence, network) >= DOUBTFUL) return [];
  return [notice("mask-doubtful", `the mask may be wrong: ${doubtOf(evidence, network, hints)}`, give("box", "click", "exclude", "mask"))];
}
