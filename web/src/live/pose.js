/** Read the rotation of a camera in the world from any kind of pose. */

import { wrong } from "../checks.js";
import { dot } from "../core/frames.js";

/** Tolerance of a rotation's columns: unit length and right angles. */
const MOST_SKEW = 0.01;

/**
 * @param {ArrayLike<number> | {elements: ArrayLike<number>} | {matrix: ArrayLike<number>} | {matrixWorld: object}} pose
 *   16 numbers column by column (a Matrix4, an XRRigidTransform, a three.js camera), or nine row by row; as it is now
 * @returns {number[]} nine numbers, row by row
 */
export function rotationOfPose(pose) {
  const given = pose.matrixWorld ?? pose;
  const m = given.elements ?? given.matrix ?? given;
  if (![9, 16].includes(m.length) || !Array.from(m).every(Number.isFinite)) {
    throw wrong("pose", "16 numbers column by column, or 9 row by row", m.length === undefined ? pose : Array.from(m));
  }
  const rotation = m.length === 9 ? [...m] : [0, 1, 2].flatMap((row) => [m[row], m[4 + row], m[8 + row]]);
  const [x, y, z] = [0, 1, 2].map((c) => [rotation[c], rotation[3 + c], rotation[6 + c]]);
  const skew = Math.max(...[x, y, z].map((one) => Math.abs(dot(one, one) - 1)), ...[dot(x, y), dot(y, z), dot(z, x)].map(Math.abs));
  const turns = dot(x, [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]);
  if (skew > MOST_SKEW || turns < 0) throw wrong("pose", "a rotation of unit scale", rotation);
  return rotation;
}
