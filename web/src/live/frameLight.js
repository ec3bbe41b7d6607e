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
import { isCutOut } from "../photo/surroundings.js";
import { resize } from "../photo/resize.js";
import { MaskFollower } from "./maskFollower.js";
import { readFrame } from "./videoFrames.js";

/** Every so many frames the mask is found anew, to be compared with the one that moves with the picture. */
const ANEW = 8;

/** An object that is not seen for so many frames is lost; until then the last light stays. */
const PATIENCE = 8;

/** The spheres, and half as many frames later the networks' stages, are sent every so many frames. */
const REST_EVERY = 8;

export class FrameLight {
  /**
   * @param {import("../networks/models.js").Models} models
   * @param {{find: Find, again: Find}} masks find: of what is marked, all looks that a still picture has; again: of an object
   *   that was found before, by one look at its box
   * @typedef {(picture: object, hints: object) => Promise<{mask: Float32Array, quality: number}>} Find
   * @param {import("../photo/picture.js").Hints} hints as shares of width and height
   * @param {number} longFovDeg
   * @param {import("../networks/lightOfObject.js").LightOptions} [options]
   * @param {boolean} [withViews] whether spheres and the networks' stages are wanted now and then
   */
  constructor(models, masks, hints, longFovDeg, options = {}, withViews = true) {
    this.options = options;
    this.withViews = withViews;
    this.models = models;
    this.masks = masks;
    this.hints = hints;
    this.longFovDeg = longFovDeg;
    this.state = null;
    this.count = this.unseen = 0;
    this.follower = this.before = null;
    this.missed = false;
    this.size = null;
  }

  /** New clicks or a new box: the mask is found anew at the next frame. Where they find nothing, the last object stays. */
  mark(hints) {
    if (this.follower && this.#isSeen()) {
      const { hints: last, follower, mask, box, quality, isAlone } = this;
      this.before = { hints: last, follower, mask, box, quality, isAlone };
    }
    Object.assign(this, { hints, follower: null });
  }

  /**
   * @param {object} frame of takeFrame
   * @param {number} time seconds
   * @param {number[] | null} [worldFromCamera] nine numbers, row by row, of the camera when it took the frame: the light is
   *   then in the world
   * @param {{data: Float32Array, width: number, height: number} | null} [given] where the object is, of whatever size
   * @returns {Promise<object>} light, mask and box of the object, milliseconds of each part; now and then spheres and stages;
   *   {lost: true} while no object is marked or seen, {held: true} where it is not seen for a moment; `missed` where what was marked last found nothing and the object before
   *   it is followed on
   */
  async next(frame, time, worldFromCamera = null, given = null) {
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
    if (given) this.#take(picture, given);
    else await this.#findObject(picture);
    lap("mask");
    const { box, mask, quality, missed } = this;
    const size = { ...this.size, ...(missed && { missed }) };
    this.missed = false;
    this.unseen = this.#isSeen() ? 0 : this.unseen + 1;
    if (this.unseen) return { [this.follower && this.unseen < PATIENCE ? "held" : "lost"]: true, ...size };
    const crop = cropObject(picture, mask, this.longFovDeg, box);
    lap("crop");
    const phase = this.withViews ? this.count++ % REST_EVERY : -1;
    const withStages = phase === REST_EVERY / 2;
    const options = { ...this.options, isAlone: this.isAlone, withStages };
    const found = await lightOfObject(this.models, picture, this.longFovDeg, crop, options);
    const { radiance, stages, ...rest } = found;
    this.single = radiance; // this frame's own
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
    const isOfThese = this.follower !== null; // else clicked meanwhile: it may be another object's
    return { light, stages: withStages ? stages : null, spheres, mask: isOfThese ? mask : null, quality, box, ...size, ms };
  }

  /** A camera held another way sees another picture: nothing marked or found in the last one is where it was. */
  #fit({ width, height }) {
    const isTurned = this.size && (this.size.width !== width || this.size.height !== height);
    this.size = { width, height };
    if (!isTurned) return;
    Object.assign(this, { hints: { on: [], off: [], box: null }, follower: null, before: null, state: null });
  }

  #isSeen(box = this.box) {
    return Boolean(box) && Math.max(box[2] - box[0], box[3] - box[1]) >= MIN_OBJECT_PX;
  }

  /** A mask of the caller's own, which is not doubted; frames without one move it. */
  #take(picture, { data, width, height }) {
    const isFit = width === picture.width && height === picture.height;
    this.before = null;
    this.#begin(picture, isFit ? data : resize(data, 1, [width, height], [picture.width, picture.height]), null);
  }

  #begin(picture, mask, quality) {
    Object.assign(this, { mask, quality, box: objectBox(mask, picture.width), age: 0 });
    this.follower = this.#isSeen() ? new MaskFollower(picture, mask) : null;
    this.isAlone = isCutOut(picture, mask);
  }

  /** Mask and box of the object: moved with the picture, or found where it is not known or not seen where it was. */
  async #findObject(picture) {
    const { follower } = this;
    if (!follower) return this.#findMarked(picture);
    const isThere = follower.move(picture);
    this.mask = follower.mask;
    this.box = isThere ? objectBox(this.mask, picture.width) : null;
    if (isThere && ++this.age % ANEW) return;
    if (!this.masks.has) return;
    const { mask, quality } = await this.masks.again(picture, this.#hintsIn(picture));
    if (this.follower !== follower || !this.#isSeen(objectBox(mask, picture.width))) return;
    const said = follower.compare(mask);
    if (said === "other" || (said === "agrees" && !isThere)) this.#begin(picture, mask, quality);
  }

  /** The mask of what is marked, by all looks that a still picture has. */
  async #findMarked(picture) {
    const { before, hints } = this;
    const { mask, quality } = await this.masks.find(picture, this.#hintsIn(picture));
    if (this.hints !== hints) return; // clicked meanwhile: found anew at the next frame
    this.before = null;
    this.#begin(picture, mask, quality);
    if (!before || (this.#isSeen() && quality >= REFUSED)) return;
    Object.assign(this, before);
    this.missed = true;
    return this.#findObject(picture);
  }

  /** In pixels; once an object was found, the box around it stands for the click on it or the box that was given. */
  #hintsIn({ width, height }) {
    const pixels = (points) => points.map(([x, y]) => [x * width, y * height]);
    const { on, off, box } = this.hints;
    if (this.follower) return { on: [], off: pixels(off), box: this.follower.around(CONTRACT.mask.search.margin) };
    return { on: pixels(on), off: pixels(off), box: box && [0, 2].flatMap((i) => pixels([box.slice(i, i + 2)])[0]) };
  }
}
