/** What is odd about a mask that was given, as anyprobe.masks.check. */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { give, notice } from "../notices.js";
import { MIN_OBJECT_PX, objectBox } from "./picture.js";

const { full: FULL, mostly: MOSTLY, grey: GREY, grey_share: GREY_SHARE, few_px: FEW_PX, alpha_most: ALPHA_MOST } = CONTRACT.mask.given;

const percent = (share) => `${(100 * share).toFixed(0)}%`;

/** Refuse a mask without an object, or with one that is too small. @param {string[]} [subject] the option that gave it */
export function checkObject(mask, width, subject = []) {
  const box = objectBox(mask, width);
  const remedy = subject.length ? [] : give("click", "box");
  if (box === null) throw new AnyProbeError("no-object", "expected an object, got a mask that marks none", { subject, remedy });
  const across = Math.max(box[2] - box[0], box[3] - box[1]);
  if (across < MIN_OBJECT_PX) {
    throw new AnyProbeError("no-object", `expected an object of ${MIN_OBJECT_PX} pixels across or more, got ${across}; go closer`, { subject });
  }
}

/**
 * The mask, and a line for whatever is odd about it. A segmenter's overlay, which is translucent on the object too, is brought
 * to 1 there.
 *
 * @param {Float32Array} mask
 * @param {number} width of the picture
 * @returns {{mask: Float32Array, warnings: import("../notices.js").Notice[]}}
 */
export function lookAtGiven(mask, width) {
  const warnings = [];
  const most = mask.reduce((a, b) => Math.max(a, b), 0);
  if (most <= 0.5) return { mask, warnings }; // nothing is marked
  if (most < FULL) {
    const advice = "save the mask itself, white on black, to be sure";
    warnings.push(notice("mask-grey", `the mask is nowhere white (at most ${most.toFixed(2)}), as a segmenter's overlay is; read as if it were: ${advice}`));
    mask = mask.map((value) => value / most);
  }
  const height = mask.length / width;
  let [inside, grey, border] = [0, 0, 0];
  for (let i = 0; i < mask.length; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    if (mask[i] > GREY[0] && mask[i] < GREY[1]) grey++;
    if (!(mask[i] > 0.5)) continue;
    inside++;
    border += (x === 0) + (x === width - 1) + (y === 0) + (y === height - 1); // corners count twice
  }
  if (inside > MOSTLY * mask.length && border > FULL * 2 * (width + height)) {
    const advice = "invert it if so: white is the object";
    warnings.push(notice("mask-inverted", `the mask covers ${percent(inside / mask.length)} of the photo and its borders, as one does that is white around the object; ${advice}`));
  }
  if (grey > GREY_SHARE * inside) {
    warnings.push(notice("mask-grey", "the mask is grey over wide areas; give one that is white on the object and black beside it"));
  }
  const [x0, y0, x1, y1] = objectBox(mask, width);
  if (Math.max(x1 - x0, y1 - y0) < FEW_PX) {
    warnings.push(notice("object-small", `the object is ${x1 - x0} x ${y1 - y0} pixels in its mask; use a larger photo or go closer: so few tell little of the light`));
  }
  return { mask, warnings };
}

/**
 * A line where a picture's transparency leaves nearly all of it as the object.
 *
 * @param {Float32Array} mask
 * @returns {import("../notices.js").Notice[]}
 */
export function alphaDoubts(mask) {
  const share = mask.reduce((sum, value) => sum + (value > 0.5), 0) / mask.length;
  if (share <= ALPHA_MOST) return [];
  const text = `its transparency makes ${percent(share)} of the photo the object; if it is smaller, say where it is`;
  return [notice("alpha-wide", text, give("click", "box", "mask"))];
}
