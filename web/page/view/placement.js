/** Where a virtual object stands by default: on the ground beside the real one, all of it in the photo, and as large as fits. */

/** Shares of the size asked for, the largest first. */
const SHARES = [1, 0.85, 0.72, 0.6, 0.5, 0.42, 0.35, 0.28, 0.2];
/** Where else it is tried, from the row that the real object stands on to the lowest of the photo. */
const NEARER = [0, 0.5, 1];
/** Kept free at the photo's border, of its width; and between the two objects, of the virtual one's. */
const [MARGIN, GAP] = [0.02, 0.15];
/** Changes of place until it is where it was meant: what is nearer is larger. */
const STEPS = 4;

/**
 * @typedef {object} Spot
 * @property {number} x of the foot, pixels
 * @property {number} y
 * @property {number} share of the size that was asked for
 * @property {boolean} [isBehind] whether there is no room beside the real object or in front of it
 */

/**
 * @param {object} photo
 * @param {Float32Array} photo.mask of the real object
 * @param {number} photo.width
 * @param {number[]} photo.box of mask > 0.5, x0, y0, x1, y1
 * @param {number} photo.row on which both stand: the lowest that is seen of them
 * @param {number} photo.behind row of the ground behind the real object
 * @param {(spot: Spot) => number[]} extentAt what the object covers there, x0, y0, x1, y1 in pixels
 * @returns {Spot}
 */
export function findSpot({ mask, width, box, row, behind }, extentAt) {
  const [height, edge] = [mask.length / width, MARGIN * width];
  const bordersIn = bordersOf(mask, width);
  const lowest = height - edge;
  const sides = width - box[2] >= box[0] ? [1, -1] : [-1, 1];
  for (const share of SHARES) {
    for (const nearer of NEARER) {
      for (const side of sides) {
        const spot = moved({ share, y: Math.min(row, lowest) + nearer * Math.max(lowest - row, 0) }, extentAt, ([x0, y0, x1, y1]) => {
          const borders = bordersIn(y0, y1);
          if (borders[0] > borders[1]) return (box[0] + box[2] - x0 - x1) / 2; // all of it is in front
          return side > 0 ? borders[1] + GAP * (x1 - x0) - x0 : borders[0] - GAP * (x1 - x0) - x1;
        });
        const [x0, y0, x1, y1] = extentAt(spot);
        if (x0 >= edge && x1 <= width - edge && y0 >= edge && y1 <= lowest + 1) return spot;
      }
    }
  }
  const atBorder = ([x0, , x1]) => (sides[0] > 0 ? width - edge - x1 : edge - x0);
  return { ...moved({ share: 1, y: behind }, extentAt, atBorder), isBehind: true };
}

/** The spot at which the object's lowest point is on a row, and it is where `across` moves it to. */
function moved({ share, y: row }, extentAt, across) {
  let [x, y] = [0, row];
  for (let step = 0; step < STEPS; step++) {
    const covered = extentAt({ x, y, share });
    [x, y] = [x + across(covered), y + row - covered[3]];
  }
  return { x, y, share };
}

/** What says how far a mask's object reaches to the left and to the right in some rows: under what overhangs there is room. */
function bordersOf(mask, width) {
  const rows = Array.from({ length: mask.length / width }, () => [width, 0]);
  mask.forEach((value, i) => {
    if (!(value > 0.5)) return;
    const [borders, x] = [rows[Math.floor(i / width)], i % width];
    if (x < borders[0]) borders[0] = x;
    borders[1] = x + 1;
  });
  return (top, bottom) =>
    rows.slice(Math.max(Math.floor(top), 0), Math.max(Math.ceil(bottom), 1)).reduce(([a, b], [c, d]) => [Math.min(a, c), Math.max(b, d)], [width, 0]);
}
