/** One video frame after the other to a light that stays still on a still scene. */

import { CONTRACT } from "../core/contract.js";
import { MAP_HEIGHT } from "../core/latlong.js";
import { rotateOne } from "../light/environment.js";
import { shadeSpheres } from "../light/spheres.js";
import { describe } from "../light/light.js";
import { lightOfObject } from "../networks/lightOfObject.js";
import { shown, step } from "../light/temporal.js";
import { cropObject } from "../photo/crop.js";
import { MIN_OBJECT_PX, objectBox } from "../photo/picture.js";
import { REFUSED } from "../photo/quality.js";
import { isCutOut, isDarkBeside } from "../photo/surroundings.js";
import { readFrame } from "./videoFrames.js";
import { blockMeans, hasMoved } from "./motion.js";

/** The mask is found anew every so many frames: objects move slower than light is wanted. */
const MASK_EVERY = 4;

/** And every so many while the picture is the one it was found in. */
const MASK_EVERY_STILL = 32;

/** The spheres, and half as many frames later the networks' stages, are sent every so many frames. */
const REST_EVERY = 8;

export class FrameLight {
  /**
   * @param {import("../networks/models.js").Models} models
   * @param {(picture: object, hints: object) => Promise<{mask: Float32Array, quality: number}>} findMask
   * @param {import("../photo/picture.js").Hints} hints as shares of width and height
   * @param {number} longFovDeg
   * @param {import("../networks/lightOfObject.js").LightOptions} [options]
   * @param {boolean} [withViews] whether spheres and the networks' stages are wanted now and then
   */
  constructor(models, findMask, hints, longFovDeg, options = {}, withViews = true) {
    this.options = options;
    this.withViews = withViews;
    this.models = models;
    this.findMask = findMask;
    this.hints = hints;
    this.longFovDeg = longFovDeg;
    this.state = null;
    this.count = 0;
    this.masked = this.before = null;
    this.missed = false;
    this.size = null;
  }

  /** New clicks or a new box: the mask is found anew at the next frame. Where they find nothing, the last object stays. */
  mark(hints) {
    if (this.masked && this.#isSeen()) this.before = { hints: this.hints, follow: this.follow };
    this.#lookFor({ hints, follow: null });
  }

  #lookFor({ hints, follow }) {
    Object.assign(this, { hints, follow, masked: null });
  }

  /**
   * @param {object} frame of takeFrame
   * @param {number} time seconds
   * @param {number[] | null} [worldFromCamera] nine numbers, row by row, of the camera when it took the frame: the light is
   *   then in the world
   * @returns {Promise<object>} light, box of the object, milliseconds of each part; now and then spheres and stages,
   *   and the mask and its quality when it is a new one; {lost: true} while no object is marked or seen; `missed` where what
   *   was marked last found nothing and the object before it is followed on
   */
  async next(frame, time, worldFromCamera = null) {
    const ms = {};
    const start = performance.now();
    let begun = start;
    const lap = (part) => {
      const now = performance.now();
      ms[part] = now - begun;
      begun = now;
    };
    const picture = readFrame(frame);
    this.#fit(picture);
    lap("read");
    const isNew = await this.#findObject(picture);
    lap("mask");
    const { box, mask, missed } = this;
    const size = { ...this.size, ...(missed && { missed }) };
    this.missed = false;
    if (!this.#isSeen()) return { lost: true, ...size };
    const crop = cropObject(picture, mask, this.longFovDeg, box);
    lap("crop");
    const phase = this.withViews ? this.count++ % REST_EVERY : -1;
    const withStages = phase === REST_EVERY / 2;
    const options = { ...this.options, isAlone: this.isAlone, withStages };
    const found = await lightOfObject(this.models, picture, this.longFovDeg, crop, options);
    const { radiance, stages, ...rest } = found;
    const isInWorld = worldFromCamera !== null;
    if (isInWorld !== this.isInWorld) this.state = null;
    this.isInWorld = isInWorld;
    if (isInWorld && rest.confidence) rest.confidence = rotateOne(rest.confidence, MAP_HEIGHT, worldFromCamera);
    lap("network");
    const dt = this.time === undefined ? 1 / 30 : Math.max(time - this.time, 1e-3);
    this.time = time;
    this.state = step(this.state, radiance, dt, worldFromCamera);
    const steady = shown(this.state);
    lap("filter");
    const light = { ...describe(steady), ...rest, isInWorld };
    lap("describe");
    const spheres = phase === 0 ? shadeSpheres(isInWorld ? shown(this.state, worldFromCamera) : light.radiance) : null;
    lap("spheres");
    ms.all = performance.now() - start;
    const isOfThese = isNew && this.masked !== null; // else clicked meanwhile: it may be another object's
    return { light, stages: withStages ? stages : null, spheres, mask: isOfThese ? mask : null, quality: this.quality, box, ...size, ms };
  }

  /** A camera held another way sees another picture: nothing marked or found in the last one is where it was. */
  #fit({ width, height }) {
    const isTurned = this.size && (this.size.width !== width || this.size.height !== height);
    this.size = { width, height };
    if (!isTurned) return;
    this.#lookFor({ hints: { on: [], off: [], box: null }, follow: null });
    this.before = this.state = null;
  }

  #isSeen() {
    const { box } = this;
    return Boolean(box) && Math.max(box[2] - box[0], box[3] - box[1]) >= MIN_OBJECT_PX;
  }

  /** Mask and box of the object, and whether it is cut out, found anew where they may have changed; whether they were. */
  async #findObject(picture) {
    const seen = blockMeans(picture);
    if (this.masked && this.box) {
      const every = hasMoved(seen, this.masked.seen) ? MASK_EVERY : MASK_EVERY_STILL;
      if (++this.masked.age < every) return false;
    }
    const masked = { seen, age: 0 };
    this.masked = masked;
    Object.assign(this, await this.findMask(picture, this.#hintsIn(picture)));
    this.box = objectBox(this.mask, picture.width);
    this.isAlone = isCutOut(picture, this.mask) || isDarkBeside(picture, this.mask);
    if (this.masked !== masked) return false; // clicked meanwhile: found anew at the next frame
    const { before } = this;
    this.before = null;
    if (before && (!this.#isSeen() || this.quality < REFUSED)) {
      this.#lookFor(before);
      this.missed = true;
      return this.#findObject(picture);
    }
    this.#followObject(picture);
    return true;
  }

  /** In pixels; once an object was found, the box around it stands for the click on it or the box that was given. */
  #hintsIn({ width, height }) {
    const pixels = (points) => points.map(([x, y]) => [x * width, y * height]);
    const { on, off, box } = this.hints;
    if (this.follow) return { on: [], off: pixels(off), box: this.follow };
    return { on: pixels(on), off: pixels(off), box: box && [0, 2].flatMap((i) => pixels([box.slice(i, i + 2)])[0]) };
  }

  /** A click or a box moves with the object: to its box and a margin, by which it may have moved at the next look. */
  #followObject({ width, height }) {
    const { on, box } = this.hints;
    if ((on.length === 0 && !box) || this.box === null) return;
    const [x0, y0, x1, y1] = this.box;
    const more = CONTRACT.mask.search.margin * Math.max(x1 - x0, y1 - y0);
    this.follow = [Math.max(x0 - more, 0), Math.max(y0 - more, 0), Math.min(x1 + more, width), Math.min(y1 + more, height)];
  }
}
