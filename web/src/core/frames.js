/**
 * Vectors and rotations. Right-handed, +X right, +Y up, the camera looks along -Z.
 *
 * Vectors are [x, y, z]; matrices are nine numbers, row by row.
 */

export const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];

export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function normalize(v) {
  const length = Math.hypot(...v);
  return v.map((value) => value / length);
}

/** a b: turn by b first, then by a. */
export function multiply(a, b) {
  const product = new Array(9);
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 3; column++) {
      product[3 * row + column] =
        a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column];
    }
  }
  return product;
}

/** A vector turned by a rotation. */
export function turned(a, [x, y, z]) {
  return [0, 3, 6].map((row) => a[row] * x + a[row + 1] * y + a[row + 2] * z);
}

/** The same by the inverse rotation. */
export function turnedBack(a, [x, y, z]) {
  return [0, 1, 2].map((column) => a[column] * x + a[column + 3] * y + a[column + 6] * z);
}

/** The shortest rotation that carries -Z to a unit direction (Rodrigues' formula). */
export function turnTowards(direction) {
  const [x, y, z] = normalize(direction);
  const cosine = -z;
  if (cosine < -1 + 1e-9) return [-1, 0, 0, 0, 1, 0, 0, 0, -1];
  const axis = [y, -x, 0]; // (0, 0, -1) x direction
  const k = [0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0];
  const kk = multiply(k, k);
  return IDENTITY.map((value, i) => value + k[i] + kk[i] / (1 + cosine));
}
