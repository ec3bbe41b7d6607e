/** Small systems of linear equations. */

/**
 * Solve matrix x = right for each right side, by Gaussian elimination with pivots.
 *
 * @param {ArrayLike<number>[]} matrix
 * @param {ArrayLike<number>[]} rights
 * @returns {number[][]}
 */
export function solved(matrix, rights) {
  const size = matrix.length;
  const lines = matrix.map((line, i) => [...line, ...rights.map((right) => right[i])]);
  for (let a = 0; a < size; a++) {
    let pivot = a;
    for (let b = a + 1; b < size; b++) if (Math.abs(lines[b][a]) > Math.abs(lines[pivot][a])) pivot = b;
    [lines[a], lines[pivot]] = [lines[pivot], lines[a]];
    for (let b = 0; b < size; b++) {
      if (b === a) continue;
      const share = lines[b][a] / lines[a][a];
      for (let c = a; c < lines[b].length; c++) lines[b][c] -= share * lines[a][c];
    }
  }
  return rights.map((_, k) => lines.map((line, a) => line[size + k] / line[a]));
}

/**
 * Residuals of values [P] after a least-squares fit of terms [P][T].
 *
 * @param {ArrayLike<number>[]} terms
 * @param {ArrayLike<number>} values
 * @returns {Float64Array}
 */
export function besideFit(terms, values) {
  const size = terms[0].length;
  const matrix = Array.from({ length: size }, () => new Float64Array(size));
  const right = new Float64Array(size);
  terms.forEach((term, i) => {
    for (let a = 0; a < size; a++) {
      right[a] += term[a] * values[i];
      for (let b = 0; b < size; b++) matrix[a][b] += term[a] * term[b];
    }
  });
  const [fit] = solved(matrix, [right]);
  return Float64Array.from(terms, (term, i) => values[i] - fit.reduce((sum, share, a) => sum + share * term[a], 0));
}
