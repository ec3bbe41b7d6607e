/**
 * An object's mask from frame to frame: moved with the picture in every one, by registration to the frame it was found in, so
 * that no error grows; what is found anew is believed where it agrees.
 */

import { objectBox } from "../photo/picture.js";
import { STILL, beginKey, isSure, lumaOf, matrixOf, register } from "./registration.js";

const [ROOM, AGREE, STAYS] = [0.25, 0.7, 3];

export class MaskFollower {
  #picture = null; // and mask, of which the key is made when it is first wanted
  #key = null;
  #others = []; // masks found one after the other that disagree with the one that is followed

  /** @param {import("../photo/picture.js").Picture} picture @param {Float32Array} mask where the object is in it */
  constructor(picture, mask) {
    this.#picture = picture;
    this.mask = this.first = mask;
    this.size = [picture.width, picture.height];
    this.motion = STILL;
    this.errorPx = 0;
    this.window = windowAround(objectBox(mask, picture.width), ROOM, this.size);
  }

  /**
   * The mask where its object is in another picture of the same size.
   *
   * @param {import("../photo/picture.js").Picture} picture
   * @returns {boolean} whether it is there; else the mask stays where it was
   */
  move(picture) {
    this.#key ??= this.#begin();
    const { center } = this.#key;
    const places = [[0, 1], [2, 1], [0, 3], [2, 3]].map((corner) => moved(this.motion, center, corner.map((at) => this.window[at])));
    const [across, down] = [0, 1].map((axis) => places.map((place) => place[axis]));
    const around = [Math.min(...across), Math.min(...down), Math.max(...across), Math.max(...down)];
    const window = windowAround(around, 0, this.size);
    if (!window) return false;
    const found = register(this.#key, lumaOf(picture, window), this.motion, window);
    if (!isSure(found)) return false;
    this.motion = found.motion;
    this.errorPx = found.errorPx;
    this.mask = warp(this.first, this.size, found.motion, center);
    return true;
  }

  /**
   * Whether a mask that was found in the last picture is taken for the one that is followed: it agrees, or several in a row
   * agree with each other and not with it.
   *
   * @returns {"agrees" | "odd" | "other"} other: it is to be followed from here on
   */
  compare(mask) {
    if (overlap(mask, this.mask) >= AGREE) {
      this.#others = [];
      return "agrees";
    }
    const isSame = this.#others.every((other) => overlap(mask, other) >= AGREE);
    this.#others = isSame ? [...this.#others, mask] : [mask];
    return this.#others.length >= STAYS ? "other" : "odd";
  }

  /** Box of the last mask and a margin in its longer sides. */
  around(margin) {
    return windowAround(objectBox(this.mask, this.size[0]), margin, this.size);
  }

  #begin() {
    const [x0, y0, x1, y1] = this.window;
    const width = this.size[0];
    const cover = new Float32Array((x1 - x0) * (y1 - y0));
    for (let y = y0; y < y1; y++) cover.set(this.first.subarray(y * width + x0, y * width + x1), (y - y0) * (x1 - x0));
    const key = beginKey(lumaOf(this.#picture, this.window), cover, this.window);
    this.#picture = null;
    return key;
  }
}

/** Where a place of the key lies. */
function moved(motion, [cx, cy], [x, y]) {
  const [a, b, c, d] = matrixOf(motion);
  return [cx + motion.x + a * (x - cx) + b * (y - cy), cy + motion.y + c * (x - cx) + d * (y - cy)];
}

/** A box and room in its longer sides, in whole pixels of a picture; null where none of it is in the picture. */
function windowAround([x0, y0, x1, y1], room, [width, height]) {
  const more = room * Math.max(x1 - x0, y1 - y0);
  const window = [Math.max(Math.floor(x0 - more), 0), Math.max(Math.floor(y0 - more), 0), Math.min(Math.ceil(x1 + more), width), Math.min(Math.ceil(y1 + more), height)];
  return window[2] - window[0] > 1 && window[3] - window[1] > 1 ? window : null;
}

/** A mask moved: at each pixel what lies there of the first one, linear between its pixels. */
export function warp(mask, [width, height], motion, [cx, cy]) {
  const size = Math.exp(-motion.scale);
  const [cos, sin] = [size * Math.cos(motion.angle), size * Math.sin(motion.angle)];
  const out = new Float32Array(mask.length);
  for (let y = 0, i = 0; y < height; y++) {
    const down = y + 0.5 - cy - motion.y;
    for (let x = 0; x < width; x++, i++) {
      const across = x + 0.5 - cx - motion.x;
      const u = cos * across + sin * down + cx - 0.5;
      const v = cos * down - sin * across + cy - 0.5;
      if (!(u > -1 && u < width && v > -1 && v < height)) continue;
      const [left, top] = [Math.floor(u), Math.floor(v)];
      const [right, below] = [u - left, v - top];
      const at = top * width + left;
      const [isLeft, isRight, isTop, isBelow] = [left >= 0, left < width - 1, top >= 0, top < height - 1];
      let value = 0;
      if (isTop && isLeft) value += (1 - right) * (1 - below) * mask[at];
      if (isTop && isRight) value += right * (1 - below) * mask[at + 1];
      if (isBelow && isLeft) value += (1 - right) * below * mask[at + width];
      if (isBelow && isRight) value += right * below * mask[at + width + 1];
      out[i] = value;
    }
  }
  return out;
}

/** Intersection over union of what two masks cover. */
export function overlap(one, other) {
  let [both, either] = [0, 0];
  for (let i = 0; i < one.length; i++) {
    const [a, b] = [one[i] > 0.5, other[i] > 0.5];
    if (a && b) both++;
    if (a || b) either++;
  }
  return either ? both / either : 1;
}
