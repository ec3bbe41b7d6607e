/**
 * Vectors and rotations. Right-handed, +X right, +Y up, the camera looks along -Z.
 *
 * Vectors are [x, y, z]; matrices are nine numbers, row by row.
 */

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** A vector turned by a rotation. */
export const turned = (a, [x, y, z]) => [0, 3, 6].map((row) => a[row] * x + a[row + 1] * y + a[row + 2] * z);

export function unit(vector) {
  const length = Math.hypot(...vector);
  return vector.map((value) => value / length);
}
