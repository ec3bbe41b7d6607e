/** How good a found mask is, as anyprobe.masks.find: what the network expects of it, and what its outline says. */

import { CONTRACT } from "../core/contract.js";
import { expectedOf } from "./search.js";
import { give, notice } from "../notices.js";

/** Expected IoU below which a mask comes with a warning, and below which there is none; how a cut outline lowers it. */
export const { doubtful: DOUBTFUL, refused: REFUSED, cut: CUT } = CONTRACT.mask.quality;

/** Factors of a finding's expected IoU, each from 0 to 1, by what a low one means in a few words. */
export function reasonsFor(found) {
  return {
    "its outline is blurred": expectedOf(found) ** 2,
    "the box cuts it off, and should be around all of it": 1 / (1 + CUT * found.cut),
    "the picture hardly changes across its outline": 1 / (1 + found.flat),
  };
}

/** Expected IoU of a finding. */
export const expectedIou = (found) => Object.values(reasonsFor(found)).reduce((product, factor) => product * factor, 1);

/** What lowers the expected IoU most, in a few words. */
export function doubtOf(found) {
  const [[reason]] = Object.entries(reasonsFor(found)).sort(([, one], [, other]) => one - other);
  return reason;
}

/** A line about what looks wrong if the expected IoU is low. @returns {import("../notices.js").Notice[]} */
export function warningsOf(found) {
  if (expectedIou(found) >= DOUBTFUL) return [];
  return [notice("mask-doubtful", `the mask may be wrong: ${doubtOf(found)}`, give("box", "click", "exclude", "mask"))];
}
