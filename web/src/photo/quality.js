/**
 * How good a found mask is, as anyprobe.masks.quality: what the network expects of it, and whether another look gives the
 * same object.
 */

import { CONTRACT } from "../core/contract.js";
import { borderShare, expectedOf, singleOf } from "./search.js";

const { quality: QUALITY, search: NUMBERS } = CONTRACT.mask;

/** Expected IoU below which a mask comes with a warning, and below which there is none. */
export const { doubtful: DOUBTFUL, refused: REFUSED } = QUALITY;

/**
 * What speaks for a mask, each from 0 to 1 where 1 is good, and what makes masks doubtful, by the names of
 * anyprobe.masks.quality.Evidence.
 *
 * @param {import("./search.js").Finding} found
 * @param {number} width of the picture
 * @param {number} height
 */
export function examine(found, width, height) {
  const [x0, y0, x1, y1] = found.window;
  const cells = found.part.reduce((sum, value) => sum + value, 0) / NUMBERS.grid ** 2;
  const share = (cells * (x1 - x0) * (y1 - y0)) / (width * height);
  return {
    expected: expectedOf(found),
    agreed: found.agreed,
    whole: found.whole,
    single: singleOf(found),
    border: borderShare(found, [0, 0, width, height], true),
    small: Math.log(Math.max(0.05 / Math.max(share, 1e-5), 1)),
    large: Math.max(share - 0.6, 0) / 0.4,
  };
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
    [evidence.single - 0.95, "two things may hang together in it"],
    [0.15 - evidence.border, "it is cut by the photo's border"],
    [0.9 - evidence.small, "it is very small"],
    [0.1 - evidence.large, "it covers nearly the whole photo"],
  ]
    .filter(([margin]) => margin < 0)
    .sort(([a], [b]) => a - b)
    .map(([, words]) => words);
}

/** A line of what looks wrong, where little is to be expected. @returns {string[]} */
export function warningsOf(evidence, quality) {
  if (quality >= DOUBTFUL) return [];
  const [first] = doubts(evidence);
  return [`The mask may be wrong (expected IoU ${quality.toFixed(2)}${first ? `: ${first}` : ""}).`];
}
