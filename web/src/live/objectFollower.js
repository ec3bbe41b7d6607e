/**
 * Follow the object, as anyprobe.video.following: found once by marks, or given, and moved with the picture from then on.
 *
 * @typedef {(picture: object, hints: object) => Promise<{mask: Float32Array, quality: number}>} Find its mask is empty where
 *   nothing was found
 * @typedef {{find: Find, again: Find, has: boolean}} Masks find: of what is marked, all looks that a still picture has; again:
 *   of an object that was lost, by one look at its last box; has: whether there is a network
 */

import { isLarge, objectBox } from "../photo/picture.js";
import { REFUSED } from "../photo/quality.js";
import { resize } from "../photo/resize.js";
import { foundIn, follow, hold, isOneObject, litMask, maskIn } from "./heldMask.js";
import { isSure } from "./registration.js";

/** Share by which the last mask's box is grown on each side to be the next prompt. */
const GROWTH = 0.08;

/** So many frames after one in which the object was not where it could be, the picture before it is tried first. */
const ODD = 2;

export class ObjectFollower {
  #held = null; // the mask that moves with the object
  #before = null; // what was held until it was lost, so many frames ago
  #lostFor = 0;
  #given = null; // picture and mask of the caller's, of which a held mask is made when a frame comes without
  #search = null; // for what was marked: its hints, and the answer once it has come

  /** @param {Masks} masks @param {import("../photo/picture.js").Hints} hints as shares of width and height */
  constructor(masks, hints) {
    Object.assign(this, { masks, hints, quality: null, last: null });
  }

  /** Whether the last frame's object was found and looked as in the frames before, so that its light is theirs. */
  get looksSame() {
    return this.#held?.looksSame ?? false;
  }

  /** Whether the last marks are still being searched. */
  get isSearching() {
    return this.#search !== null;
  }

  /**
   * New clicks or a new box: the mask is looked for in the next frame, while the last object is followed on. It stays where they
   * find nothing.
   */
  mark(hints) {
    this.#search = { hints };
  }

  /** Forget all marks and masks: the picture has changed. */
  forget() {
    this.last = this.#held = this.#given = this.#before = null;
    this.mark({ on: [], off: [], box: null });
  }

  /**
   * The object's mask in a frame.
   *
   * @param {{data: Float32Array, width: number, height: number} | null} given the caller's own mask of it
   * @returns {Promise<{mask: Float32Array, box: number[], lit: Float32Array, isNew: boolean, missed?: true} | null>} box: around
   *   the mask; lit: as the light is to be estimated by; null: it is not seen, or something was marked meanwhile
   */
  async next(picture, given = null) {
    if (given) this.#search = null;
    else if (!this.last) this.#search ??= { hints: this.hints };
    const search = this.#search;
    if (search) search.asked ??= this.#ask(search, picture);
    if (!this.last) await search?.asked;
    let found = given ? this.#take(picture, given) : this.last ? await this.#move(picture) : null;
    if (search?.answer && search === this.#search) found = await this.#settle(search, picture, found);
    return found && isAny(found.lit) ? found : null;
  }

  async #ask(search, picture) {
    try {
      search.answer = { picture, ...(await this.masks.find(picture, hintsIn(search.hints, picture))) };
    } catch (error) {
      search.answer = { error };
    }
  }

  /** What was looked for is here: it is followed from now on, unless it is nothing and another object is followed. */
  async #settle({ hints, answer }, picture, followed) {
    this.#search = null;
    if (answer.error) throw answer.error;
    const isFound = isLarge(objectBox(answer.mask, answer.picture.width));
    if (this.last && !(isFound && answer.quality >= REFUSED)) return followed && { ...followed, missed: true };
    this.hints = hints;
    if (!isFound) return null;
    this.quality = answer.quality;
    this.#given = this.#before = null;
    const begun = this.#begin(answer.picture, answer.mask);
    if (answer.picture === picture) return begun;
    const moved = await this.#move(picture);
    return moved && { ...moved, isNew: true };
  }

  /** A mask of the caller's own, which is not doubted; frames without one move it. */
  #take(picture, { data, width, height }) {
    const isFit = width === picture.width && height === picture.height;
    const mask = isFit ? data : resize(data, 1, [width, height], [picture.width, picture.height]);
    this.quality = this.#held = this.#before = null;
    if (!isAny(mask)) return null;
    this.#given = { picture, mask };
    this.last = lastOf(mask, picture.width);
    return { mask, box: this.last.extent, lit: mask, isNew: true };
  }

  #begin(picture, mask) {
    this.#held = hold(picture, mask);
    this.last = lastOf(mask, picture.width);
    return { mask, box: this.last.extent, lit: litMask(this.#held), isNew: true };
  }

  /** The held mask moved to its object's place in this frame. */
  async #move(picture) {
    const { hints } = this;
    const known = [this.#held, this.#before, this.#lostFor];
    if (this.#given) {
      this.#held = hold(this.#given.picture, this.#given.mask);
      this.#given = null;
    }
    const isNew = await this.#isFollowed(picture);
    if (this.hints !== hints || isNew === null) return null;
    const mask = maskIn(this.#held);
    const last = lastOf(mask, picture.width);
    if (!last.extent || !isOneObject(last.count, this.last.count)) {
      [this.#held, this.#before, this.#lostFor] = known;
      return null;
    }
    this.last = last;
    return { mask, box: last.extent, lit: litMask(this.#held), isNew };
  }

  /** Whether the mask differs from the one held; null: the object is not seen. */
  async #isFollowed(picture) {
    const { hints, masks } = this;
    if (++this.#lostFor > ODD) this.#before = null;
    for (const held of [this.#before, this.#held]) {
      const found = held && foundIn(held, picture);
      if (!found || !isSure(found)) continue;
      if (held === this.#before) this.#before = null;
      this.#held = follow(held, picture, found);
      return false;
    }
    if (!masks.has) return null;
    const found = (await this.#lookedFor(picture, this.last)) ?? (await this.#lookedFor(picture, this.last, masks.find));
    if (!found || this.hints !== hints) return null;
    if (!this.#before) [this.#before, this.#lostFor] = [this.#held, 0];
    this.quality = found.quality;
    this.#held = hold(picture, found.mask);
    return true;
  }

  /** The mask by one look at the last one's box and a margin, or by another search; null where nothing is there. */
  async #lookedFor(picture, { point, box }, search = this.masks.again) {
    const found = await search(picture, { on: [point], off: [], box });
    return isAny(found.mask) ? found : null;
  }
}

/** In pixels. */
function hintsIn({ on, off, box }, { width, height }) {
  const pixels = (points) => points.map(([x, y]) => [x * width, y * height]);
  return { on: pixels(on), off: pixels(off), box: box && [0, 2].flatMap((i) => pixels([box.slice(i, i + 2)])[0]) };
}

/** Whether a mask covers a pixel. */
function isAny(mask) {
  let at = 0;
  while (at < mask.length && !(mask[at] > 0.5)) at++;
  return at < mask.length;
}

/** A mask's pixels, the box around them, and a point inside and the box, grown, by which it is looked for, made when read. */
function lastOf(mask, width) {
  let count = 0;
  for (let at = 0; at < mask.length; at++) count += mask[at];
  const extent = objectBox(mask, width);
  return {
    count,
    extent,
    get point() {
      return innerPoint(mask, width);
    },
    get box() {
      const [x0, y0, x1, y1] = extent;
      const [right, down] = [GROWTH * (x1 - x0), GROWTH * (y1 - y0)];
      return [Math.max(x0 - right, 0), Math.max(y0 - down, 0), Math.min(x1 + right, width), Math.min(y1 + down, mask.length / width)];
    },
  };
}

/** x, y of the pixel of a mask that is nearest to the middle of all. */
function innerPoint(mask, width) {
  const inside = [];
  mask.forEach((value, at) => value > 0.5 && inside.push([at % width, Math.floor(at / width)]));
  const [x, y] = [0, 1].map((axis) => inside.reduce((sum, place) => sum + place[axis], 0) / inside.length);
  const away = (place) => (place[0] - x) ** 2 + (place[1] - y) ** 2;
  return inside.reduce((best, place) => (away(place) < away(best) ? place : best));
}
