/**
 * The networks' own thread: pictures in, lights out, so that drawing keeps its frame rate.
 *
 * Messages are {id, task, ...arguments}; each is answered by {id, result} or {id, error}, unless {giveUp: id} comes first.
 * A camera's frames have no id: lights come as {live: answer} or {live: {error}}, of the newest frame whenever the last
 * light is done.
 */

import { sentError } from "../errors.js";
import { describe } from "../light/light.js";
import { shadeSpheres } from "../light/spheres.js";
import { checkObject } from "../photo/maskCheck.js";
import { FrameLight } from "../live/frameLight.js";
import { Newest } from "../live/newest.js";
import { lightOfStill } from "./lightOfStill.js";
import { answerAt, findMask, masksAt, videoMasks } from "./masks.js";
import { Models } from "./models.js";
import { openRuntime } from "./runtime.js";
import { openingFault } from "./words.js";

/** Between two tries while no object is seen. */
const LOST_MS = 100;

let models = null;
let live = null;

const tasks = {
  async open({ runtime, weights, engine, threads: most }) {
    const onProgress = (progress) => self.postMessage({ progress });
    let threads = 1;
    try {
      const opened = await openRuntime(runtime, engine, most, onProgress);
      threads = opened.threads;
      models = await Models.open(opened.ort, weights, { providers: [engine], onProgress });
      const maskNetwork = models.hasU2netp ? "u2netp" : models.hasMask ? "small" : null;
      return { engine, threads, hasMask: maskNetwork !== null, maskNetwork };
    } catch (error) {
      throw openingFault(error, threads, typeof runtime !== "string");
    }
  },

  /**
   * The mask of a still picture from clicks or a box; without any, what stands out. With its quality, the IoU to expect,
   * a line where that is little, and the seconds it took without the opening of a network.
   */
  mask({ picture, hints }, isGivenUp) {
    return findMask(models, picture, hints, isGivenUp);
  },

  /** The light, and for a page that shows them its stages and three spheres. */
  async estimate({ picture, mask, marks, longFovDeg, isLensKnown, normals, options, withViews }) {
    const start = performance.now();
    checkObject(mask, picture.width, marks);
    const lens = { longFovDeg, isLensKnown };
    const { radiance, stages, saidErrorDeg, ...rest } = await lightOfStill(models, picture, lens, mask, { ...options, normals });
    const light = { ...describe(radiance, saidErrorDeg), ...rest };
    const seconds = (performance.now() - start) / 1000;
    return withViews ? { light, stages, spheres: shadeSpheres(radiance), seconds } : { light, seconds };
  },

  /** Find a video's masks for the lights' thread. */
  serveMasks({ port }) {
    answerAt(port, models);
  },

  startLive({ hints, longFovDeg, isLensKnown, options, withViews, port }) {
    const masks = port ? masksAt(port, models) : videoMasks(models);
    const lights = new FrameLight(models, masks, hints, longFovDeg, { ...options, isLensKnown }, withViews);
    const frames = new Newest(
      (given) => sendLight(lights, given),
      ({ frame }) => letGo(frame),
    );
    live = { lights, frames };
  },

  frame({ frame, time, pose, mask }) {
    live.frames.offer({ frame, time, pose, mask });
  },

  markLive({ hints }) {
    live.lights.mark(hints);
  },

  setLive({ options }) {
    live.lights.options = { ...live.lights.options, ...options };
  },
};

/** The light of a frame to the caller, unless it has begun anew meanwhile. */
async function sendLight(lights, { frame, time, pose, mask }) {
  let answer;
  try {
    answer = await lights.next(frame, time, pose, mask);
  } catch (error) {
    answer = { error: sentError(error) };
  }
  if (lights === live.lights) self.postMessage({ live: answer }, answer.light ? memoryOf(answer.light) : []);
  letGo(frame);
  if (answer.lost) await new Promise((resolve) => setTimeout(resolve, LOST_MS));
}

/** What of a light is given away with it instead of copied. */
function memoryOf({ radiance, confidence, prefiltered }) {
  return [radiance, ...(confidence ? [confidence] : []), ...prefiltered].map(({ buffer }) => buffer);
}

/** Close a frame that is done with, or give its memory back for another. */
function letGo(frame) {
  if (frame.bytes) self.postMessage({ spare: frame.bytes.buffer }, [frame.bytes.buffer]);
  else frame.close();
}

/** Requests that are worked on, and whether each has been given up. */
const asked = new Map();

self.onmessage = async ({ data: { id, task, giveUp, ...given } }) => {
  if (giveUp !== undefined) return asked.has(giveUp) && asked.set(giveUp, true);
  if (id === undefined) return tasks[task](given);
  asked.set(id, false);
  const answer = {};
  try {
    answer.result = await tasks[task](given, () => asked.get(id));
  } catch (error) {
    answer.error = sentError(error);
  }
  const isGivenUp = asked.get(id);
  asked.delete(id);
  if (!isGivenUp) self.postMessage({ id, ...answer });
};
