/** How good a found mask is, as anyprobe.masks.find: what the network expects of it, and whether another look gives the same object. */

import { CONTRACT } from "../core/contract.js";
import { expectedOf } from "./search.js";
import { give, notice } from "../notices.js";

/** Expected IoU below which a mask comes with a warning, and below which there is none. */
export const { doubtful: DOUBTFUL, refused: REFUSED } = CONTRACT.mask.quality;
/** How much a box that cuts the object off lowers it, and the share of a flat outline that makes it doubtful. */
const { cut: CUT, flat: FLAT } = CONTRACT.mask.quality;

/** Factors of a finding's expected IoU, each from 0 to 1, by what a low one means in a few words. */
export function reasonsFor(found) {
  return {
    "its outline is blurred": expectedOf(found),
    "a second look finds something else": (1 + found.agreed) / 2,
    "the box cuts it off, and should be around all of it": 1 / (1 + CUT * found.cut),
    "the picture hardly changes across its outline": found.flat > FLAT ? DOUBTFUL : 1,
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
