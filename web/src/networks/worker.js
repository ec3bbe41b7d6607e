/**
 * The networks' own thread: pictures in, lights out, so that drawing keeps its frame rate.
 *
 * Messages are {id, task, ...arguments}; each is answered by {id, result} or {id, error}. A camera's frames have no id:
 * lights are told as {live: answer} or {live: {error}}, of the newest frame whenever the last light is done.
 */

import { describe, cameraRadiance } from "../light/light.js";
import { drawSpheres } from "../light/spheres.js";
import { cropObject } from "../photo/crop.js";
import { cutOut, cutOutOfBox } from "../photo/cutOut.js";
import { flood } from "../photo/flood.js";
import { MIN_OBJECT_PX, objectBox } from "../photo/picture.js";
import { propose } from "../photo/propose.js";
import { resize } from "../photo/resize.js";
import { seeAround, shareOf, useSurroundings } from "../photo/surroundings.js";
import { FrameLight } from "../live/frameLight.js";
import { Newest } from "../live/newest.js";
import { Models } from "./models.js";
import { chooseEngine, openRuntime } from "./runtime.js";

/** Between two tries while no object is seen. */
const LOST_MS = 100;

let models = null;
let live = null;

const tasks = {
  async open({ base, weights, engine, threads: most }) {
    const onProgress = (done, of) => self.postMessage({ progress: { done, of } });
    const provider = chooseEngine(engine);
    try {
      const { ort, threads } = await openRuntime(base, provider, most);
      models = await Models.open(ort, weights, { providers: [provider], onProgress });
      return { provider, threads, hasMask: models.hasMask };
    } catch (error) {
      throw new Error(`The networks could not be opened, try again: ${error.message ?? error}.`);
    }
  },

  /** The mask of a still picture from clicks or a box; without any, the network's own proposal. */
  mask({ picture, hints }) {
    return findMask(picture, hints);
  },

  async estimate({ picture, mask, longFovDeg, asked }) {
    const start = performance.now();
    checkObject(mask, picture.width);
    const crop = cropObject(picture, mask, longFovDeg);
    const { surroundings, spread } = usable(asked);
    const around = surroundings ? seeAround(picture, longFovDeg, crop) : null;
    const guess = await models.light(crop.image, crop.tanHalf, { around, spread });
    const stages = around ? useSurroundings(guess, around) : guess;
    const light = describe(cameraRadiance(stages, crop.cameraFromCrop));
    const { cameraFromCrop, centerPx, sidePx } = crop;
    const seconds = (performance.now() - start) / 1000;
    const known = { surroundings: around ? shareOf(around) : 0 };
    const spheres = drawSpheres(light.radiance);
    return { light, stages, known, spread, spheres, cameraFromCrop, centerPx, sidePx, seconds };
  },

  startLive({ hints, longFovDeg, asked }) {
    const lights = new FrameLight(models, findMaskQuickly, hints, longFovDeg, usable(asked));
    const frames = new Newest(
      (given) => tellLight(lights, given),
      ({ frame }) => letGo(frame),
    );
    live = { lights, frames };
  },

  frame({ frame, time }) {
    live.frames.offer({ frame, time });
  },

  markLive({ hints }) {
    live.lights.mark(hints);
  },

  askLive({ asked }) {
    live.lights.asked = usable(asked);
  },
};

/**
 * What may be asked of the light, as far as this model can do it.
 *
 * @param {Asked} asked
 * @typedef {{surroundings: boolean, spread: boolean}} Asked surroundings: what is seen beside the object is part of the
 *   light; spread: its lamps lie over all places as likely as they are
 */
function usable({ surroundings, spread }) {
  return { surroundings: surroundings && models.lifts, spread: spread && models.lifts };
}

/** The light of a frame to the page, unless it has begun anew meanwhile. */
async function tellLight(lights, { frame, time }) {
  let answer;
  try {
    answer = await lights.next(frame, time);
  } catch (error) {
    answer = { error: error.message ?? String(error) };
  }
  if (lights === live.lights) self.postMessage({ live: answer }, answer.light ? memoryOf(answer.light) : []);
  letGo(frame);
  if (answer.lost) await new Promise((resolve) => setTimeout(resolve, LOST_MS));
}

/** What of a light is given away with it instead of copied. */
function memoryOf({ radiance, prefiltered }) {
  return [radiance, ...prefiltered].map(({ buffer }) => buffer);
}

/** Close a frame that is done with, or give its memory back for another. */
function letGo(frame) {
  if (frame.bytes) self.postMessage({ spare: frame.bytes.buffer }, [frame.bytes.buffer]);
  else frame.close();
}

/** The mask of a picture, cut out along the photo's own edges. */
async function findMask(picture, hints) {
  if (hints.box) return cutOutOfBox(picture, hints);
  if (!models.hasMask) return flood(picture, hints);
  const cover = await propose((input) => models.mask(input), picture, hints);
  return cutOut(picture, cover, hints);
}

/** The same at one look and without refining, for video. */
async function findMaskQuickly(picture, hints) {
  if (!models.hasMask) return flood(picture, hints);
  const cover = await propose((input) => models.mask(input), picture, hints, { again: false });
  const { width, height } = picture;
  return resize(cover.values, 1, [cover.width, cover.height], [width, height]);
}

function checkObject(mask, width) {
  const box = objectBox(mask, width);
  if (box === null) throw new Error("No object is marked. Click on it in the picture “Object”.");
  const across = Math.max(box[2] - box[0], box[3] - box[1]);
  if (across < MIN_OBJECT_PX) {
    throw new Error(`The object is ${across} pixels across; ${MIN_OBJECT_PX} are needed. Go closer.`);
  }
}

self.onmessage = async ({ data: { id, task, ...given } }) => {
  if (id === undefined) return tasks[task](given);
  try {
    self.postMessage({ id, result: await tasks[task](given) });
  } catch (error) {
    self.postMessage({ id, error: error.message ?? String(error) });
  }
};
