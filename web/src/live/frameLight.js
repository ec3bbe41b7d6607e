/** Turn video frames into a light that is steady on a still scene. */

import { MAP_HEIGHT } from "../core/latlong.js";
import { inverseResponse } from "../core/response.js";
import { rotateOne } from "../light/environment.js";
import { describe } from "../light/light.js";
import { lightOfObject } from "../networks/lightOfObject.js";
import { SAME_AFTER_S, shown, step } from "../light/temporal.js";
import { isLarge } from "../photo/picture.js";
import { ObjectFollower } from "./objectFollower.js";
import { readFrame } from "./videoFrames.js";

/** Frames without the object after which it is lost; until then the last light stays. */
const PATIENCE = 8;

/**
 * While the object looks the same, and the filter doubts nothing, the networks rest for so many frames, and for as many more as
 * there are in so many seconds; these frames have their last answer. One thread has time for more frames then.
 */
const [REST_FRAMES, REST_S] = [2, 0.25];

export class FrameLight {
  /**
   * @param {import("./objectFollower.js").Masks} masks
   * @param {import("../photo/picture.js").Hints} hints as shares of width and height
   * @param {import("../networks/lightOfObject.js").LightOptions} [options]
   */
  constructor(models, masks, hints, longFovDeg, options = {}) {
    this.options = options;
    this.models = models;
    this.longFovDeg = longFovDeg;
    this.object = new ObjectFollower(masks, hints);
    this.state = this.size = null;
    this.unseen = this.rested = 0;
    this.found = null; // the networks' last answer
  }

  /** New clicks or a new box: their mask is searched while the last object's light continues. */
  mark(hints) {
    this.object.mark(hints);
  }

  /**
   * @param {object} frame of takeFrame
   * @param {number} time seconds
   * @param {number[] | null} [worldFromCamera] nine numbers, row by row, of the camera when it took the frame: the light is
   *   then in the world
   * @param {{data: Float32Array, width: number, height: number} | null} [given] where the object is, of whatever size
   * @param {(outline: object) => void} [tell] hears of the mask before the light is there
   * @returns {Promise<object>} light, time, mask and box of the object;
   *   {lost: true} with the picture's mean radiance while no object is marked or seen, {held: true} where it is not seen for a moment; `missed` where what was
   *   marked last found nothing and the object before it is followed on,
   *   `searching` while it is looked for
   */
  async next(frame, time, worldFromCamera = null, given = null, tell = () => {}) {
    const picture = readFrame(frame);
    this.#fit(picture);
    const seen = await this.object.next(picture, given);
    const box = seen?.box ?? null;
    const isSeen = isLarge(box);
    this.unseen = isSeen ? 0 : this.unseen + 1;
    if (!isSeen && this.object.last && this.unseen < PATIENCE) return { held: true, ...this.size };
    if (!isSeen) return { lost: true, mean: meanRadiance(picture), ...this.size };
    const { mask, lit, isNew, missed } = seen;
    const { quality, isSearching } = this.object;
    const outline = { time, mask, quality, box, ...this.size, ...(missed && { missed }), ...(isSearching && { searching: true }) };
    tell(outline);
    if (!this.object.looksSame) this.otherAt = time;
    const isAsked = isNew || missed || worldFromCamera !== null;
    if (isAsked || !this.#mayRest(time)) {
      this.found = await lightOfObject(this.models, picture, lit, this.longFovDeg, this.options);
      [this.rested, this.lookedAt, this.lookedWith] = [0, time, this.options];
    } else {
      this.rested++;
    }
    const { radiance, said: _, ...rest } = this.found;
    if (rest.confidence) rest.confidence = rest.confidence.slice(); // its memory is given away with the answer
    const isInWorld = worldFromCamera !== null;
    if (isInWorld !== this.isInWorld) this.state = null;
    this.isInWorld = isInWorld;
    if (isInWorld && rest.confidence) rest.confidence = rotateOne(rest.confidence, MAP_HEIGHT, worldFromCamera);
    const dt = this.time === undefined ? 1 / 30 : Math.max(time - this.time, 1e-3);
    this.time = time;
    this.state = step(this.state, radiance, dt, worldFromCamera, this.object.looksSame);
    return { light: { ...describe(shown(this.state)), ...rest, isInWorld }, ...outline };
  }

  /** Whether the last answer serves this frame, which is neither marked nor turned. */
  #mayRest(time) {
    const { state, found, options } = this;
    const isSteady = found && state && !state.held && state.oddS === 0 && time - this.otherAt > SAME_AFTER_S;
    const isSoon = this.rested < REST_FRAMES || time - this.lookedAt < REST_S;
    return isSteady && isSoon && this.lookedWith === options;
  }

  /** A camera held another way sees another picture: nothing marked or found in the last one is where it was. */
  #fit({ width, height }) {
    const isTurned = this.size && (this.size.width !== width || this.size.height !== height);
    this.size = { width, height };
    if (!isTurned) return;
    this.object.forget();
    this.state = null;
  }
}

/** Mean radiance of a picture, from so many of its pixels. */
const SAMPLES = 4096;

function meanRadiance({ rgba }) {
  const step = 4 * Math.max(1, Math.floor(rgba.length / 4 / SAMPLES));
  const sum = [0, 0, 0];
  for (let at = 0; at < rgba.length; at += step) for (let c = 0; c < 3; c++) sum[c] += inverseResponse(rgba[at + c] / 255);
  return sum.map((value) => value / Math.ceil(rgba.length / step));
}
