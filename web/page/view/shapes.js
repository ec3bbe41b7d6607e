/** The virtual objects that the command line has too, by the same names: anyprobe.files.objects, drawn numbers and all. */

import { BufferAttribute, BufferGeometry, LatheGeometry, SphereGeometry, Vector2 } from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

const ROWS = 56;

/** Radius and height of the vase from its mouth to its foot. */
const VASE = [
  [0, 0.9045], [0.1419, 0.8491], [0.187, 0.7937], [0.2108, 0.7383], [0.2225, 0.6829], [0.2065, 0.6275], [0.1896, 0.5722],
  [0.1804, 0.5168], [0.1769, 0.4614], [0.1746, 0.406], [0.1723, 0.3506], [0.1725, 0.2952], [0.1906, 0.2398], [0.24, 0.1844],
  [0.3106, 0.1291], [0.3852, 0.0737], [0.4599, 0.0183], [0.5317, -0.0371], [0.587, -0.0925], [0.6157, -0.1479],
  [0.6278, -0.2033], [0.6371, -0.2587], [0.6464, -0.314], [0.6538, -0.3694], [0.6506, -0.4248], [0.632, -0.4802],
  [0.6046, -0.5356], [0.5759, -0.591], [0.5472, -0.6464], [0.521, -0.7018], [0.5068, -0.7571], [0.509, -0.8125],
  [0.4752, -0.8679], [0.4105, -0.9045], [0, -0.9045],
];

/** Waves of the pebble: frequency times axis x, y, z, amplitude, phase; and its stretch. */
const WAVES = [
  [0.67185, -0.61651, -2.00286, 0.12118, 0.03307], [1.90445, -0.69943, -0.8817, 0.05685, 1.60058],
  [-3.98958, -0.12542, 2.98126, 0.07474, 3.90729], [-1.96814, -2.81092, -0.3588, 0.02532, 0.22407],
  [-0.25476, -3.42997, -0.73416, 0.06519, 3.12037], [-0.63483, -1.30024, -1.07477, 0.07383, 0.02345],
  [3.75294, -2.47653, -0.47401, 0.05717, 5.3201], [0.11694, 2.08687, -2.37609, 0.06816, 5.47201],
];
const PEBBLE_STRETCH = [0.92013, 1.06068, 0.76763];

/** Exponents of the block's superquadric around +Y and up, and its stretch. */
const [EAST, NORTH] = [0.60318, 0.65296];
const BLOCK_STRETCH = [1.3692, 0.66492, 1.10528];

/** Planes of the solid as normal over distance, and the power that rounds its edges. */
const PLANES = [
  [-0.34442, 1.1568, 0.32585], [-0.61911, -0.00302, -0.808], [-0.0005, -1.02445, 0.18079], [0.02729, 1.27974, 0.31929],
  [-0.37765, -0.75091, 1.09856], [-0.70593, 0.53435, -0.62482], [-0.47759, -0.79271, -1.24991], [-0.39316, -0.09476, 1.2578],
  [-0.56162, -0.00159, -0.88954], [0.38097, -0.95989, 0.05252], [-0.273, -1.1933, 0.7625], [-0.39828, 1.13721, 1.02752],
  [-0.62019, -0.68121, -0.5878], [0.88967, 0.75, -0.18513], [-0.25918, -0.98926, -1.01216], [-0.77149, -0.07913, 0.97564],
  [-1.44125, -0.61931, 0.26508], [-0.90901, -0.40987, -0.5449], [-0.03795, -0.79096, 0.94578], [0.77312, 0, 0.47825],
  [0, 0.90909, 0], [-0.47825, 0, 0.77312], [-0.77312, 0, -0.47825], [0, -0.90909, 0], [0.47825, 0, -0.77312],
];
const POWER = 22.584;

const scaled = (vector, factors) => vector.map((value, i) => value * factors[i]);
const power = (value, exponent) => Math.sign(value) * Math.abs(value) ** exponent;

function pebble([x, y, z]) {
  const radius = WAVES.reduce((sum, [a, b, c, amplitude, phase]) => sum + amplitude * Math.sin(a * x + b * y + c * z + phase), 1);
  return scaled([x, y, z].map((value) => value * Math.max(radius, 0.25)), PEBBLE_STRETCH);
}

function block([x, y, z]) {
  const t = Math.acos(Math.min(Math.max(y, -1), 1)) - Math.PI / 2;
  const p = Math.atan2(x, z);
  const level = power(Math.cos(t), NORTH);
  const point = [level * power(Math.sin(p), EAST), -power(Math.sin(t), NORTH), level * power(Math.cos(p), EAST)];
  return scaled(point, BLOCK_STRETCH);
}

function solid(direction) {
  const heights = PLANES.map((plane) => Math.max(plane[0] * direction[0] + plane[1] * direction[1] + plane[2] * direction[2], 0));
  const largest = Math.max(...heights);
  const gauge = largest * heights.reduce((sum, height) => sum + (height / largest) ** POWER, 0) ** (1 / POWER);
  return direction.map((value) => value / gauge);
}

/** A closed surface: where each direction from its middle is moved to. */
function surface(move, creaseDeg = 180) {
  const columns = 2 * ROWS;
  const points = [];
  for (let row = 0; row < ROWS; row++) {
    for (let column = 0; column < columns; column++) {
      const [t, p] = [((row + 0.5) * Math.PI) / ROWS, (column * 2 * Math.PI) / columns];
      points.push(move([Math.sin(t) * Math.sin(p), Math.cos(t), Math.sin(t) * Math.cos(p)]));
    }
  }
  points.push(move([0, 1, 0]), move([0, -1, 0]));
  const [top, bottom] = [points.length - 2, points.length - 1];
  const faces = [];
  for (let column = 0; column < columns; column++) {
    const next = (column + 1) % columns;
    faces.push(top, column, next, bottom, (ROWS - 1) * columns + next, (ROWS - 1) * columns + column);
    for (let row = 0; row < ROWS - 1; row++) {
      const [a, b] = [row * columns + column, row * columns + next];
      faces.push(a, a + columns, b + columns, a, b + columns, b);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(points.flat()), 3));
  geometry.setIndex(faces);
  if (creaseDeg < 180) return toCreasedNormals(geometry, (creaseDeg * Math.PI) / 180);
  geometry.computeVertexNormals();
  return geometry;
}

/** Name to geometry, of any size and place. */
export const SHAPES = {
  sphere: () => new SphereGeometry(1, 64, 32),
  vase: () => toCreasedNormals(new LatheGeometry(VASE.map(([x, y]) => new Vector2(x, y)).reverse(), 96), (50 * Math.PI) / 180),
  pebble: () => surface(pebble),
  block: () => surface(block, 45),
  solid: () => surface(solid),
};
