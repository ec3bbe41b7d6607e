/** Where the object is, by the mask network that is loaded: U2-Net-p, else the small one. */

import { AnyProbeError, receivedError, sentError } from "../errors.js";
import { notice } from "../notices.js";
import { SmallNetwork, U2NetP, untilGivenUp } from "../photo/maskNetworks.js";
import { REFUSED, examine, expectedIou, warningsOf } from "../photo/quality.js";
import { Looks, findObject, lookAgain, maskOf } from "../photo/search.js";
import { smallNetworkWarning } from "./words.js";

/**
 * The mask of a still picture, with the IoU to expect, a line where that is little, and the seconds it took.
 *
 * @param {import("./models.js").Models} models
 * @param {import("../photo/picture.js").Picture} picture
 * @param {import("../photo/picture.js").Hints} hints
 * @param {() => boolean} isGivenUp
 */
export async function findMask(models, picture, hints, isGivenUp) {
  const network = networkOf(models);
  const start = performance.now();
  const looks = new Looks(untilGivenUp(network, isGivenUp), picture, looksKept(network.name, picture));
  const { evidence, ...found } = await searchBy(looks, hints, findObject);
  const warnings = evidence ? warningsOf(evidence, network.name, hints) : [notice("no-object", "nothing stands out there")];
  if (evidence && network.name === "small") warnings.push(smallNetworkWarning(hints));
  return { ...found, warnings, seconds: (performance.now() - start) / 1000 };
}

/** How a video's masks are found: what is marked as in a still picture, an object that was lost by one look where it was. */
function videoMasks(models) {
  const network = networkOf(models);
  return {
    find: (picture, hints) => searchBy(new Looks(network, picture, looksKept(network.name, picture)), hints, findObject),
    again: (picture, hints) => searchBy(new Looks(network, picture), hints, lookAgain),
  };
}

/**
 * videoMasks of another thread, at the other end of a port: lights go on while it looks.
 *
 * @param {MessagePort | null} port null: there is no network of masks
 * @returns {import("../live/objectFollower.js").Masks}
 */
export function masksAt(port) {
  if (!port) return { find: async () => networkOf({ sessions: {} }), again: null, has: false };
  let fault = null;
  const waiting = [];
  port.onmessage = ({ data: { found, error } }) => {
    const { resolve, reject } = waiting.shift() ?? {};
    if (error) (reject ?? ((one) => (fault = one)))(receivedError(error)); // of a thread that did not open, before anything was asked
    else resolve(found);
  };
  const by = (search) => async ({ width, height, rgba }, hints) => {
    if (fault) throw fault;
    return new Promise((resolve, reject) => {
      waiting.push({ resolve, reject });
      port.postMessage({ search, picture: { width, height, rgba }, hints });
    });
  };
  return { find: by("find"), again: by("again"), has: true };
}

/** Answer what masksAt asks, in its order. */
export function answerAt(port, models) {
  const masks = videoMasks(models);
  let last = Promise.resolve();
  port.onmessage = ({ data: { search, picture, hints } }) => {
    const answer = async () => ({ found: await masks[search](picture, hints) });
    last = last.then(answer).catch((error) => ({ error: sentError(error) })).then((one) => port.postMessage(one));
  };
}

/** Looks at the last picture: another mark on it, or on a camera's that shows the same, asks for what is near it alone. */
let last = { name: "", picture: null, looks: new Map() };

function looksKept(name, picture) {
  if (last.name !== name || !isAlike(last.picture, picture)) last = { name, picture, looks: new Map() };
  return last.looks;
}

/** Levels of 255 by which noise alone changes a pixel, the share of pixels that may change by more, and every how manyth is compared. */
const [NOISE, CHANGED, EVERY] = [24, 0.005, 7];

function isAlike(one, other) {
  if (one?.width !== other.width || one.height !== other.height) return false;
  const green = Array.from({ length: Math.ceil(other.rgba.length / 4 / EVERY) }, (_, i) => 4 * EVERY * i + 1);
  return green.filter((at) => Math.abs(one.rgba[at] - other.rgba[at]) > NOISE).length <= CHANGED * green.length;
}

async function searchBy(looks, hints, search) {
  const { network, picture } = looks;
  const { width, height } = picture;
  const found = await search(looks, hints);
  const evidence = found && examine(found, hints);
  const quality = found ? expectedIou(evidence, network.name) : 0;
  if (quality < REFUSED) return { mask: new Float32Array(width * height), quality: 0, evidence: null };
  return { mask: maskOf(found, width, height), quality, evidence };
}

function networkOf(models) {
  if (models.sessions.u2netp) return new U2NetP(models);
  if (models.sessions.mask) return new SmallNetwork(models);
  throw new AnyProbeError("no-object", "No mask network is loaded: pass a mask, or load one (weights.mask, weights.u2netp).");
}
