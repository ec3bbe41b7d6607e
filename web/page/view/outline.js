/** The part of a picture that an object covers: its points and their pixels. */

import { Matrix4, Vector3 } from "three";

/** Objects with more points than this are thinned. */
const MOST_POINTS = 4000;

/** Pixel far outside, for points at or behind the camera. */
const FAR_PX = 1e4;

/**
 * @param {import("three").Group} group
 * @returns {Float32Array} x, y, z of points in the group's own frame
 */
export function outlineOf(group) {
  group.updateMatrixWorld(true); // what is bound to bones follows this alone
  const inverse = group.matrixWorld.clone().invert();
  const points = [];
  const point = new Vector3();
  group.traverse((part) => {
    if (!part.isMesh) return;
    const toGroup = new Matrix4().multiplyMatrices(inverse, part.matrixWorld);
    const { count } = part.geometry.attributes.position;
    for (let i = 0; i < count; i++) points.push(...part.getVertexPosition(i, point).applyMatrix4(toGroup).toArray());
  });
  const step = Math.ceil(points.length / 3 / MOST_POINTS);
  return Float32Array.from(points.filter((_, i) => Math.floor(i / 3) % step === 0));
}

/**
 * @param {Float32Array} outline of outlineOf
 * @param {Matrix4} clipFromGroup
 * @param {number} width of the picture
 * @param {number} height
 * @returns {number[]} x0, y0, x1, y1 in pixels
 */
export function extentOf(outline, clipFromGroup, width, height) {
  const m = clipFromGroup.elements;
  let [x0, y0, x1, y1] = [FAR_PX, FAR_PX, -FAR_PX, -FAR_PX];
  for (let i = 0; i < outline.length; i += 3) {
    const [x, y, z] = [outline[i], outline[i + 1], outline[i + 2]];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0) return [-FAR_PX, -FAR_PX, FAR_PX, FAR_PX];
    const u = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w + 1) * (width / 2);
    const v = (1 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w) * (height / 2);
    x0 = Math.min(x0, u);
    x1 = Math.max(x1, u);
    y0 = Math.min(y0, v);
    y1 = Math.max(y1, v);
  }
  return [x0, y0, x1, y1];
}
