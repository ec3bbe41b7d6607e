/**
 * How good a found mask is, as anyprobe.masks.quality: what the network expects of it, and whether another look gives the
 * same object.
 */

import { CONTRACT } from "../core/contract.js";
import { borderShare, boxOf, expectedOf, singleOf } from "./search.js";
import { give, notice } from "../notices.js";

const { quality: QUALITY, search: NUMBERS } = CONTRACT.mask;
const { fits: FITS } = QUALITY;
const GRID = NUMBERS.grid;

/** Expected IoU below which a mask comes with a warning, and below which there is none. */
export const { doubtful: DOUBTFUL, refused: REFUSED } = QUALITY;

/**
 * What speaks for a mask, each from 0 to 1 where 1 is good, and what makes masks doubtful, by the names of
 * anyprobe.masks.quality.Evidence.
 *
 * @param {import("./search.js").Finding} found
 * @param {number} width of the picture
 * @param {number} height
 * @param {import("./picture.js").Hints} hints by which it was found
 */
export function examine(found, width, height, hints) {
  const [x0, y0, x1, y1] = found.window;
  const cells = found.part.reduce((sum, value) => sum + value, 0) / GRID ** 2;
  const share = (cells * (x1 - x0) * (y1 - y0)) / (width * height);
  return {
    expected: expectedOf(found),
    agreed: found.agreed,
    whole: found.whole,
    single: singleOf(found),
    meant: fits(found, hints),
    asked: [...(hints.on.length ? ["click"] : []), ...(hints.box ? ["box"] : [])],
    border: borderShare(found, [0, 0, width, height], true),
    small: Math.log(Math.max(0.05 / Math.max(share, 1e-5), 1)),
    large: Math.max(share - 0.6, 0) / 0.4,
  };
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

/** The IoU to expect of what a network of that name found. */
export function expectedIou(evidence, network) {
  const { offset, weights } = QUALITY[network];
  let odds = offset;
  for (const [name, weight] of Object.entries(weights)) odds += weight * evidence[name];
  return 1 / (1 + Math.exp(-odds));
}

/** What looks wrong, in a few words each, the gravest first. */
export function doubts(evidence) {
  return [
    [evidence.agreed - 0.8, "a second look finds something else"],
    [evidence.expected - 0.85, "its outline is blurred"],
    [evidence.whole - 0.7, "other things stand out as well"],
    [evidence.single - 0.95, "it may contain two objects"],
    [evidence.meant - 0.6, `it does not fit the ${evidence.asked.join(" or the ")}`],
    [0.15 - evidence.border, "it is cut by the photo's border"],
    [0.9 - evidence.small, "it is very small"],
    [0.1 - evidence.large, "it covers nearly the whole photo"],
  ]
    .filter(([margin]) => margin < 0)
    .sort(([a], [b]) => a - b)
    .map(([, words]) => words);
}

/**
 * A line of what looks wrong, where little is to be expected or colours speak against the mask.
 *
 * @param {ReturnType<typeof examine>} evidence
 * @param {number} quality expected IoU
 * @param {string[]} ofColors of colorDoubts
 * @returns {import("../notices.js").Notice[]}
 */
export function warningsOf(evidence, quality, ofColors) {
  const isDoubtful = quality < DOUBTFUL;
  if (!isDoubtful && !ofColors.length) return [];
  const [first = "the network is unsure of it"] = [...ofColors, ...(isDoubtful ? doubts(evidence) : [])];
  const text = `the mask may be wrong: ${first}`;
  return [notice("mask-doubtful", text, give("box", "click", "exclude", "mask"))];
}
