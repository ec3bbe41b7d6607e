/** Colour: linear Rec. 709 primaries, and the false colours of the paper's figures. */

/** Relative luminance of linear Rec. 709. */
export function luminance(r, g, b) {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

/** Radiance at the end of the false colours, as in the paper. */
const FALSE_COLOR_MAX = 10;

// From violet through blue, green and yellow to red.
const STOPS = [
  [48, 18, 59], [70, 107, 227], [40, 187, 236], [49, 242, 153], [162, 252, 60],
  [237, 208, 58], [251, 128, 34], [210, 49, 5], [122, 4, 3],
];

/** Radiance to a false colour [r, g, b], 0 to 255; values above the range take its last colour. */
export function falseColor(radiance, max = FALSE_COLOR_MAX) {
  const place = (Math.min(Math.max(radiance / max, 0), 1)) * (STOPS.length - 1);
  const index = Math.min(Math.floor(place), STOPS.length - 2);
  const share = place - index;
  return STOPS[index].map((value, channel) => value + share * (STOPS[index + 1][channel] - value));
}
