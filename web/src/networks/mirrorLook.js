/** A second look at an object's crop, in a mirror, as anyprobe.estimate.mirror_look takes it. */

import { luminance } from "../core/color.js";
import { MAP_HEIGHT, pixelSolidAngles } from "../core/latlong.js";
import { CONTEXT_SIZE, CROP_SIZE, NORMALS_SIZE } from "../photo/crop.js";

/**
 * The likelier of two answers of Models.light, the second to the crop in a mirror; with stages.
 *
 * @param {import("./models.js").Models} models
 * @param {{image: Float32Array, tanHalf: number}} crop
 * @param {object} asked options of Models.light
 */
export async function likelierLook(models, { image, tanHalf }, asked) {
  const options = { ...asked, withStages: true };
  const one = await models.light(image, tanHalf, options);
  const { normals, surroundings, context, up } = options;
  const other = await models.light(flipped(image, CROP_SIZE), tanHalf, {
    ...options,
    normals: normals && turned(flipped(normals, NORMALS_SIZE)),
    surroundings: surroundings && flipped(surroundings, 2 * MAP_HEIGHT),
    context: context && flipped(context, CONTEXT_SIZE),
    up: up && [-up[0], up[1], up[2]],
  });
  return likelier(one, mirroredBack(other));
}

/** The answer to a mirrored crop in the frame of the crop itself. */
function mirroredBack(answer) {
  const { radiance, expected, confidence, irradiance, ldr, lnRadiance, posture, ...rest } = answer;
  const [map, square] = [(values) => flippedPixels(values, 2 * MAP_HEIGHT), (values) => flippedPixels(values, CROP_SIZE)];
  return {
    ...rest,
    radiance: map(radiance),
    expected: map(expected),
    confidence: confidence && flipped(confidence, 2 * MAP_HEIGHT),
    irradiance: square(irradiance),
    ldr: map(ldr),
    lnRadiance: map(lnRadiance),
    posture: posture && [posture[0], posture[1], -posture[2]],
  };
}

/** The answer whose light comes from where both expect it, with the mean of what they expect. */
function likelier(one, other) {
  const expected = one.expected.map((value, i) => (value + other.expected[i]) / 2);
  const isFirst = agreement(one.radiance, expected) >= agreement(other.radiance, expected);
  return { ...(isFirst ? one : other), expected };
}

/** Mean, over a map's light, of the luminance that is expected where it comes from. */
function agreement(radiance, expected) {
  const angles = pixelSolidAngles(MAP_HEIGHT);
  let [total, met] = [0, 0];
  for (let row = 0, at = 0; row < MAP_HEIGHT; row++) {
    for (let column = 0; column < 2 * MAP_HEIGHT; column++, at += 3) {
      const light = angles[row] * luminance(radiance[at], radiance[at + 1], radiance[at + 2]);
      total += light;
      met += light * luminance(expected[at], expected[at + 1], expected[at + 2]);
    }
  }
  return met / Math.max(total, 1e-9);
}

/** Planes [C, H, width] with every row reversed. */
function flipped(values, width) {
  const out = new Float32Array(values.length);
  for (let start = 0; start < out.length; start += width) {
    for (let column = 0; column < width; column++) out[start + column] = values[start + width - 1 - column];
  }
  return out;
}

/** Pixels [H, width, 3] with every row reversed. */
function flippedPixels(values, width) {
  const out = new Float32Array(values.length);
  for (let start = 0; start < out.length; start += 3 * width) {
    for (let column = 0; column < width; column++) {
      const from = start + 3 * (width - 1 - column);
      for (let c = 0; c < 3; c++) out[start + 3 * column + c] = values[from + c];
    }
  }
  return out;
}

/** Planes [3, H, W] of vectors with x turned round, in place. */
function turned(vectors) {
  for (let i = 0; i < vectors.length / 3; i++) vectors[i] = -vectors[i];
  return vectors;
}
