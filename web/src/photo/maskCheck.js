/** Checks of given masks, as anyprobe.masks.check. */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { give, notice } from "../notices.js";
import { MIN_OBJECT_PX, isLarge, objectBox } from "./picture.js";
import { keepObject } from "./specks.js";

const { full: FULL, mostly: MOSTLY, grey_share: GREY_SHARE, few_px: FEW_PX, alpha_most: ALPHA_MOST } = CONTRACT.mask.given;

const percent = (share) => `${(100 * share).toFixed(0)}%`;

/** Refuse a mask without an object, or with one that is too small. @param {string[]} [subject] the options that gave it */
export function checkObject(mask, width, subject = []) {
  const box = objectBox(mask, width);
  const remedy = subject.length ? [] : give("click", "box");
  if (box === null) throw new AnyProbeError("no-object", "expected an object, got no value above 0.5", { subject, remedy });
  if (isLarge(box)) return;
  const [text, of] = [`expected an object of ${MIN_OBJECT_PX} pixels across or more, got ${Math.max(box[2] - box[0], box[3] - box[1])}`, (name) => subject.includes(name)];
  if (of("box")) throw new AnyProbeError("no-object", `${text}; draw it around the whole object`, { subject: ["box"] });
  throw new AnyProbeError("no-object", `${text}; go closer`, { subject, remedy: of("click") ? give("box", "mask") : [] });
}

/**
 * The part of a given mask that matters and a warning for each oddity. A segmenter's overlay, which is translucent on the object too, is scaled to 1
 * there.
 *
 * @param {number} width of the picture
 * @returns {{mask: Float32Array, warnings: import("../notices.js").Notice[]}}
 */
export function lookAtGiven(mask, width) {
  const warnings = [];
  const brightest = mask.reduce((a, b) => Math.max(a, b), 0);
  if (brightest <= 0.5) return { mask, warnings }; // nothing is marked
  if (brightest < FULL) {
    const advice = "save the mask itself, white on black, to be sure";
    warnings.push(notice("mask-grey", `the mask is nowhere white (at most ${brightest.toFixed(2)}), like a segmenter's overlay; its brightest value is taken for white: ${advice}`));
    mask = mask.map((value) => value / brightest);
  }
  const height = mask.length / width;
  let [inside, grey, border] = [0, 0, 0];
  for (let i = 0; i < mask.length; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    if (mask[i] > CONTRACT.mask.black && mask[i] < CONTRACT.mask.white) grey++;
    if (!(mask[i] > 0.5)) continue;
    inside++;
    border += (x === 0) + (x === width - 1) + (y === 0) + (y === height - 1); // corners count twice
  }
  if (inside > MOSTLY * mask.length && border > FULL * 2 * (width + height)) {
    warnings.push(notice("mask-inverted", `the mask covers ${percent(inside / mask.length)} of the photo and its borders, as an inverted one does; if so, invert it: white is the object`));
  }
  if (grey > GREY_SHARE * inside) {
    warnings.push(notice("mask-grey", "the mask is grey over wide areas; give one that is white on the object and black elsewhere"));
  }
  const kept = keepObject(mask, width);
  mask = kept.mask;
  if (kept.large > 1) {
    warnings.push(notice("mask-parts", `the mask has ${kept.large} large parts; the largest and those close to it are taken for one object: leave one object white`));
  }
  if (kept.isOutline) warnings.push(notice("mask-outline", "the mask is only an outline; fill it: the whole object is white"));
  const [x0, y0, x1, y1] = objectBox(mask, width);
  if (Math.max(x1 - x0, y1 - y0) < FEW_PX) {
    warnings.push(notice("object-small", `the object is only ${x1 - x0} x ${y1 - y0} pixels in its mask, too few for a good estimate; use a larger photo or go closer`));
  }
  return { mask, warnings };
}

/** A warning if a picture's transparency marks nearly all of it as the object. @returns {import("../notices.js").Notice[]} */
export function alphaDoubts(mask) {
  const share = mask.reduce((sum, value) => sum + (value > 0.5), 0) / mask.length;
  if (share <= ALPHA_MOST) return [];
  const text = `its transparency marks ${percent(share)} of the photo as the object; if it is smaller, mark it`;
  return [notice("alpha-wide", text, give("click", "box", "mask"))];
}
