/** The part of a picture that an object covers: its points and their pixels. */

import { Box3, Matrix4, Vector3 } from "three";

/** Objects with more points than this are thinned. */
const MOST_POINTS = 4000;

/** Pixel far outside, for what reaches behind the camera. */
const FAR_PX = 1e4;

/** @param {import("three").Group} group @returns {Float32Array} x, y, z of points in the group's own frame */
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
 * @returns {number[]} x0, y0, x1, y1 in pixels
 */
export function extentOf(outline, clipFromGroup, width, height) {
  const [box, point] = [new Box3(), new Vector3()];
  for (let i = 0; i < outline.length; i += 3) box.expandByPoint(point.fromArray(outline, i).applyMatrix4(clipFromGroup));
  const { min, max } = box;
  if (!(max.z <= 1)) return [-FAR_PX, -FAR_PX, FAR_PX, FAR_PX];
  return [((min.x + 1) / 2) * width, ((1 - max.y) / 2) * height, ((max.x + 1) / 2) * width, ((1 - min.y) / 2) * height];
}
