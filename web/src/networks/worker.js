/**
 * The networks' own thread: pictures in, lights out, so that drawing keeps its frame rate.
 *
 * It speaks the four words of a session. Asked are {id, say, of, ...given}: `open` the networks, then `mark` the object and
 * `estimate` its light, of a still picture or of a camera's, whose frames have no id. Delivered are {id, result} or
 * {id, error}, unless {giveUp: id} comes first; {live} of the newest frame whenever the last light is done, its mask first;
 * {progress} of files; and {spare}, memory of textures. One thread finds masks and one lights, joined by a port.
 */

import { sentError } from "../errors.js";
import { describe } from "../light/light.js";
import { checkObject } from "../photo/maskCheck.js";
import { FrameLight } from "../live/frameLight.js";
import { Newest } from "../live/newest.js";
import { lightOfStill } from "./lightOfStill.js";
import { findMask, masksAt } from "./masks.js";
import { Models } from "./models.js";
import { openRuntime } from "./runtime.js";
import { openingFault } from "./words.js";

/** Between two tries while no object is seen. */
const LOST_MS = 100;

const deliver = (message, transfer = []) => self.postMessage(message, transfer);

let models = null;
let marking = Promise.resolve();

const still = {
  async open({ runtime, weights, threads: most }) {
    const onProgress = (progress) => deliver({ progress });
    let threads = 1;
    try {
      const opened = await openRuntime(runtime, most, onProgress);
      threads = opened.threads;
      models = await Models.open(opened.ort, weights, { onProgress });
      return { threads };
    } catch (error) {
      throw openingFault(error, threads, typeof runtime !== "string");
    }
  },

  /** The mask by clicks or a box; without any, of what stands out. One after the other: a network looks at one picture at a time. */
  mark({ picture, hints, isKnown }, isGivenUp) {
    marking = marking.catch(() => {}).then(() => findMask(models, picture, hints, isGivenUp, isKnown));
    return marking;
  },

  /** The light, and the seconds it took. */
  async estimate({ picture, mask, marks, longFovDeg, isLensKnown, normals, options }) {
    const start = performance.now();
    checkObject(mask, picture.width, marks);
    const lens = { longFovDeg, isLensKnown };
    const { radiance, said, ...rest } = await lightOfStill(models, picture, lens, mask, { ...options, normals });
    return { light: { ...describe(radiance, said), ...rest }, seconds: (performance.now() - start) / 1000 };
  },
};

/** Since a camera was last opened. */
let lights = null;
let frames = null;

const camera = {
  /** Follow a camera; or, in the thread of masks, find them for the one that does. */
  open({ port, hints, longFovDeg, isLensKnown, options }) {
    if (!hints) return hear(port);
    const own = (lights = new FrameLight(models, masksAt(port), hints, longFovDeg, { ...options, isLensKnown }));
    frames = new Newest(
      (given) => lightOfFrame(own, given),
      ({ frame }) => letGo(frame),
    );
  },

  /** What is said of the object from here on: where it is, or what light is wanted. */
  mark({ hints, options }) {
    if (hints) lights.mark(hints);
    lights.options = { ...lights.options, ...options };
  },

  estimate(given) {
    frames.offer(given);
  },
};

/** The mask and the light of a frame to the caller, unless it has begun anew meanwhile. */
async function lightOfFrame(own, { frame, time, pose, mask }) {
  const tell = (live, transfer) => own === lights && deliver({ live }, transfer);
  let answer;
  try {
    answer = await own.next(frame, time, pose, mask, tell);
  } catch (error) {
    answer = { error: sentError(error) };
  }
  const { mask: _, missed: __, ...rest } = answer; // which were told of before
  tell(rest, answer.light ? memoryOf(answer.light) : []);
  letGo(frame);
  if (answer.lost) await new Promise((resolve) => setTimeout(resolve, LOST_MS));
}

/** What of a light is given away with it instead of copied. */
function memoryOf({ radiance, confidence, prefiltered }) {
  return [radiance, ...(confidence ? [confidence] : []), ...prefiltered].map(({ buffer }) => buffer);
}

/** Close a frame that is done with, or give its memory back for another. */
function letGo(frame) {
  if (frame.bytes) deliver({ spare: frame.bytes.buffer }, [frame.bytes.buffer]);
  else frame.close();
}

const tasks = { still, camera };

/** Answer what is asked over a line: by the page, or by the thread of the lights. */
function hear(line) {
  const asked = new Map(); // requests that are worked on, and whether each has been given up
  line.onmessage = async ({ data: { id, say, of = "still", giveUp, ...given } }) => {
    if (giveUp !== undefined) return asked.has(giveUp) && asked.set(giveUp, true);
    if (id === undefined) return tasks[of][say](given);
    asked.set(id, false);
    const answer = {};
    try {
      answer.result = await tasks[of][say](given, () => asked.get(id));
    } catch (error) {
      answer.error = sentError(error);
    }
    const isGivenUp = asked.get(id);
    asked.delete(id);
    if (!isGivenUp) line.postMessage({ id, ...answer });
  };
}

hear(self);
