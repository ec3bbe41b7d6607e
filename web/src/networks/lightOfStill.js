/** The light of a still picture's object, unwrapped where it is a mirror ball: as anyprobe.estimate.estimator. */

import { CONTRACT } from "../core/contract.js";
import { MATERIALS, materialInput } from "../photo/material.js";
import { looksLikeBall, saidOfBall } from "../photo/mirrorBall.js";
import { sphereOfOutline } from "../photo/sphere.js";
import { lightOfObject } from "./lightOfObject.js";

const BALL = MATERIALS[CONTRACT.mirror_ball.material];

/**
 * As lightOfObject. A given material or given normals are believed.
 *
 * @param {{longFovDeg: number, isLensKnown: boolean}} lens isLensKnown: whether that is the picture's own
 * @param {import("./lightOfObject.js").LightOptions & {normals?: Float32Array | null}} options
 */
export async function lightOfStill(models, picture, { longFovDeg, isLensKnown }, mask, options) {
  const asked = { ...options, isLensKnown };
  const found = await lightOfObject(models, picture, mask, longFovDeg, asked);
  if (options.material || options.normals || found.object.metal < CONTRACT.mirror_ball.metal) return found;
  if (!looksLikeBall(picture, mask, longFovDeg)) return found;
  const { normals } = sphereOfOutline(mask, picture.width, longFovDeg);
  const unwrapped = { ...asked, normals, material: materialInput(BALL), mirror: BALL.f0 };
  const light = await lightOfObject(models, picture, mask, longFovDeg, unwrapped);
  return { ...light, hints: found.hints, warnings: [...light.warnings, saidOfBall()] };
}
