/**
 * Vectors and rotations. Right-handed, +X right, +Y up, the camera looks along -Z.
 *
 * Vectors are [x, y, z]; matrices are nine numbers, row by row.
 */

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
