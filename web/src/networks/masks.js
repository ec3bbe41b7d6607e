/** Where the object is, by the mask network that is loaded: U2-Net-p, else the small one. */

import { AnyProbeError } from "../errors.js";
import { notice } from "../notices.js";
import { SmallNetwork, U2NetP, untilGivenUp } from "../photo/maskNetworks.js";
import { REFUSED, expectedIou, warningsOf } from "../photo/quality.js";
import { Looks, findObject, lookAgain, maskOf } from "../photo/search.js";
import { smallNetworkWarning } from "./words.js";
import { WorkerClient } from "./workerClient.js";

/**
 * The mask of a picture, with the IoU to expect, a line where that is little, and the seconds it took.
 *
 * @param {() => boolean} isGivenUp
 * @param {boolean} [isKnown] whether it is an object that was lost, for which one look at its last box is enough
 */
export async function findMask(models, picture, hints, isGivenUp, isKnown = false) {
  const network = networkOf(models);
  const start = performance.now();
  const looks = new Looks(untilGivenUp(network, isGivenUp), picture, isKnown ? undefined : looksKept(network.name, picture));
  const found = await (isKnown ? lookAgain : findObject)(looks, hints);
  const quality = found ? expectedIou(found) : 0;
  const seconds = () => (performance.now() - start) / 1000;
  const { width, height } = picture;
  if (quality < REFUSED) {
    const warnings = [notice("no-object", "nothing stands out there")];
    return { mask: new Float32Array(width * height), quality: 0, warnings, seconds: seconds() };
  }
  const mask = maskOf(found, width, height);
  const lost = hints.on.filter(([x, y]) => mask[Math.floor(y) * width + Math.floor(x)] <= 0.5);
  const warnings = [...warningsOf(found), ...lost.map(lostClick)];
  if (network.name === "small") warnings.push(smallNetworkWarning(hints));
  return { mask, quality, warnings, seconds: seconds() };
}

const lostClick = ([x, y]) =>
  notice("mask-doubtful", `the mask does not hold the click at ${Math.round(x)},${Math.round(y)}; remove it, or mark the object with a box`);

/**
 * The masks that another thread finds, so that lights go on while it looks.
 *
 * @param {MessagePort | null} port to that thread; null: there is no network of masks
 * @returns {import("../live/objectFollower.js").Masks}
 */
export function masksAt(port) {
  if (!port) return { find: async () => networkOf({ sessions: {} }), again: null, has: false };
  const client = new WorkerClient(() => Object.assign(port, { terminate: () => port.close() }), () => {});
  const by = (isKnown) => ({ width, height, rgba }, hints) => client.ask("mark", { picture: { width, height, rgba }, hints, isKnown });
  return { find: by(false), again: by(true), has: true };
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

function networkOf(models) {
  if (models.sessions.u2netp) return new U2NetP(models);
  if (models.sessions.mask) return new SmallNetwork(models);
  throw new AnyProbeError("no-object", "No mask network is loaded: pass a mask, or load one (weights.mask, weights.u2netp).");
}
