/**
 * Where a virtual object stands by default: beside the real one, all of it in the photo.
 *
 * On the side with more room; on the other if only that holds it; smaller if neither does; and where it would
 * become too small, before the real one rather than over the photo's border.
 */

/** Of what was asked: beside the real object it is made no smaller. */
const LEAST_SHARE = 0.4;

/** Kept free at the photo's border, of its width; and between the two objects, of the virtual one's. */
const MARGIN = 0.02;
const GAP = 0.1;

/** Tries to fit it, how much smaller each may make it, and pixels that do not matter. */
const TRIES = 24;
const LEAST_STEP = 0.5;
const CLOSE_PX = 0.5;

/**
 * @typedef {object} Spot
 * @property {number} x of the foot, pixels
 * @property {number} y
 * @property {number} share of the size that was asked for
 */

/**
 * @param {{width: number, height: number, box: number[]}} photo its size, and the real object's x0, y0, x1, y1 in pixels
 * @param {(spot: Spot) => number[]} extentAt what the object covers there, x0, y0, x1, y1 in pixels
 * @returns {Spot}
 */
export function beside({ width, height, box }, extentAt) {
  const [x0, , x1, y1] = box;
  const edge = MARGIN * width;
  const all = [edge, edge, width - edge, height - edge];
  const sides = [
    { foot: x0, gap: -1, bounds: [edge, edge, x0, height - edge] },
    { foot: x1, gap: 1, bounds: [x1, edge, width - edge, height - edge] },
  ];
  if (width - x1 >= x0) sides.reverse();
  const found = sides.map(({ foot, gap, bounds }) => fit({ x: foot, y: y1, share: 1 }, bounds, gap, extentAt));
  const best = found[1].share > found[0].share + 0.01 ? found[1] : found[0];
  if (best.share >= LEAST_SHARE) return best;
  return fit({ x: sides[0].foot, y: y1, share: LEAST_SHARE }, all, 0, extentAt);
}

/**
 * The spot moved into the bounds, by GAP away from their side where the real object is and on its row; smaller where they
 * are too narrow. What is nearer is larger, so that one tells on the other: later tries only take away.
 */
function fit({ x, y, share: most }, [left, top, right, bottom], gap, extentAt) {
  const row = y;
  let share = most;
  if (right - left < 1) return { x, y, share: 0 };
  for (let i = 0; i < TRIES; i++) {
    const [x0, y0, x1, y1] = extentAt({ x, y, share });
    const wide = (x1 - x0) * (1 + Math.abs(gap) * GAP);
    const tall = (gap ? Math.min(y1, bottom) : bottom) - top;
    const room = Math.min((right - left) / wide, tall / (y1 - y0));
    const larger = Math.min(Math.max(room, LEAST_STEP), i < TRIES / 2 ? most / share : 1, 1 / LEAST_STEP);
    const apart = gap * GAP * (x1 - x0);
    const across = gap > 0 ? left + apart - x0 : gap < 0 ? right + apart - x1 : into(x0, x1, left, right);
    const down = gap ? Math.min(bottom - y1, row - y) : into(y0, y1, top, bottom);
    if (Math.abs(larger - 1) < 0.001 && Math.abs(across) < CLOSE_PX && Math.abs(down) < CLOSE_PX) break;
    x = Math.min(Math.max(x + across, left), right);
    y += down;
    share *= larger;
  }
  return { x, y, share };
}

/** How far a span must go to lie in another. */
function into(from, to, low, high) {
  return Math.max(low - from, 0) - Math.max(to - high, 0);
}
