/** Translate marks from the library's options to the networks' input. */

/**
 * @param {{click?: number[] | number[][], exclude?: number[] | number[][], box?: number[]}} given in pixels; one click or several
 * @param {number} [across] what a pixel's x becomes
 * @param {number} [down] likewise y
 * @returns {import("./picture.js").Hints}
 */
export function hintsOf({ click, exclude, box } = {}, across = 1, down = across) {
  const place = ([x, y]) => [x * across, y * down];
  const all = (points) => (points?.length ? (Array.isArray(points[0]) ? points : [points]).map(place) : []);
  return { on: all(click), off: all(exclude), box: box ? [...place(box.slice(0, 2)), ...place(box.slice(2))] : null };
}
