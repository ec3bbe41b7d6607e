/**
 * Where a virtual object stands by default, as anyprobe.relight.placement: beside the real one on the same ground, all of it
 * in the photo and never over the real one.
 *
 * On the side with more room, under what overhangs too; on the other if only that holds it; smaller if neither does. Where
 * it would become too small, nearer to the camera if it covers nothing there; else beside and smaller still; else behind the
 * real one, which then hides part of it.
 */

/** Smallest shares of the size asked for: beside the real object or in front of it, and beside it where both are too narrow. */
const LEAST_SHARE = 0.35, LEAST_BESIDE = 0.2;

/** Where places in front are tried, from the row that the real object stands on to the lowest of the photo. */
const FRONT_ROWS = [0.25, 0.5, 0.75, 1];

/** Kept free at the photo's border, of its width; and between the two objects, of the virtual one's. */
const MARGIN = 0.02;
const GAP = 0.15;

/** Tries to fit it, how much smaller each may make it, and pixels that do not matter. */
const TRIES = 24;
const LEAST_STEP = 0.5;
const CLOSE_PX = 0.5;

/** Ground is used up to this far below the horizon, of the photo's height. */
const LEAST_ABOVE = 0.02;

/**
 * Row of the farthest ground that is used, a little below the horizon: nothing is placed above it.
 *
 * @param {number} height of the picture
 * @param {number} focal pixels
 * @param {number} pitchDeg how far the camera looks down
 */
export function farthestRow(height, focal, pitchDeg) {
  return height / 2 - focal * Math.tan((pitchDeg * Math.PI) / 180) + LEAST_ABOVE * height;
}

/**
 * @typedef {object} Spot
 * @property {number} x of the foot, pixels
 * @property {number} y
 * @property {number} share of the size that was asked for
 * @property {"beside" | "front" | "behind"} [side] of the real object, where it stands
 */

/** How far the real object reaches to either side, row by row of its mask. */
export class Silhouette {
  /**
   * @param {Float32Array} mask
   * @param {number} width of the picture
   * @param {number[]} box x0, y0, x1, y1 of mask > 0.5
   */
  constructor(mask, width, box) {
    Object.assign(this, { width, height: mask.length / width, box });
    this.left = new Float64Array(this.height).fill(width);
    this.right = new Float64Array(this.height);
    for (let y = box[1]; y < box[3]; y++) {
      for (let x = box[0]; x < box[2]; x++) {
        if (mask[y * width + x] <= 0.5) continue;
        this.left[y] = Math.min(this.left[y], x);
        this.right[y] = x + 1;
      }
    }
  }

  /** Left and right bound of what is free in rows from top to bottom, on one side (1: right, -1: left). */
  free(top, bottom, side, [least, , most]) {
    const rows = [Math.max(Math.floor(top), 0), Math.max(Math.ceil(bottom), 1)];
    if (side > 0) return [this.right.subarray(...rows).reduce((x, right) => Math.max(x, right), least), most];
    return [least, this.left.subarray(...rows).reduce((x, left) => Math.min(x, left), most)];
  }
}

/**
 * @param {object} photo
 * @param {Silhouette} photo.silhouette of the real object
 * @param {number} photo.row on which both stand: the lowest that is seen of them
 * @param {number} photo.behind row of the ground behind the real object
 * @param {number} photo.farRow of farthestRow
 * @param {number} photo.mostBehind the share of what was asked that is tried there
 * @param {(spot: Spot) => number[]} extentAt what the object covers there, x0, y0, x1, y1 in pixels
 * @returns {Spot}
 */
export function findSpot({ silhouette, row, behind, farRow, mostBehind }, extentAt) {
  const { width, height, box } = silhouette;
  const edge = MARGIN * width;
  const bounds = [edge, edge, width - edge, height - edge];
  const sides = width - box[2] >= box[0] ? [1, -1] : [-1, 1];
  const fitted = (footRow) => {
    const [first, second] = sides.map((side) => {
      const spot = { x: side > 0 ? box[2] : box[0], y: footRow, share: 1 };
      return fit(spot, bounds, farRow, extentAt, silhouette, side);
    });
    return second.share > first.share + 0.01 ? second : first;
  };
  const beside = fitted(row);
  if (beside.share >= LEAST_SHARE) return { ...beside, side: "beside" };
  const rows = row < bounds[3] ? FRONT_ROWS.map((share) => row + share * (bounds[3] - row)) : [];
  const front = rows.map(fitted).reduce((best, spot) => (best.share >= spot.share ? best : spot), { share: 0 });
  if (front.share >= LEAST_SHARE) return { ...front, side: "front" };
  if (beside.share >= LEAST_BESIDE) return { ...beside, side: "beside" };
  const far = { x: sides[0] > 0 ? width : 0, y: behind, share: mostBehind };
  return { ...fit(far, bounds, farRow, extentAt), side: "behind" };
}

/**
 * The spot moved into the bounds, and to one side of a silhouette (1: right, -1: left), by GAP off it, its lowest point on the
 * spot's row; smaller if needed. What is nearer is larger, so that size and place depend on each other: later tries only
 * shrink.
 */
function fit({ x, y, share: most }, bounds, farRow, extentAt, silhouette = null, side = 0) {
  const row = y;
  let share = most;
  let [left, top, right, bottom] = bounds;
  for (let i = 0; i < TRIES; i++) {
    const [x0, y0, x1, y1] = extentAt({ x, y, share });
    const down = side ? Math.min(bottom, row) - y1 : into(y0, y1, top, bottom);
    if (silhouette) [left, right] = silhouette.free(y0 + down, y1 + down, side, bounds);
    const wide = (x1 - x0) * (1 + Math.abs(side) * GAP);
    const tall = (side ? Math.min(y1, bottom) : bottom) - top;
    const room = Math.min((right - left) / wide, tall / (y1 - y0));
    const larger = Math.min(Math.max(room, LEAST_STEP), i < TRIES / 2 ? most / share : 1, 1 / LEAST_STEP);
    const apart = side * GAP * (x1 - x0);
    const across = side > 0 ? left + apart - x0 : side < 0 ? right + apart - x1 : into(x0, x1, left, right);
    if (Math.abs(larger - 1) < 0.001 && Math.abs(across) < CLOSE_PX && Math.abs(down) < CLOSE_PX) break;
    x = Math.min(Math.max(x + across, left), right);
    y = Math.max(y + down, farRow);
    share *= larger;
  }
  return { x, y, share };
}

/** How far a span must go to lie in another. */
function into(from, to, low, high) {
  return Math.max(low - from, 0) - Math.max(to - high, 0);
}
