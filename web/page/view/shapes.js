/** The virtual objects of the page. */

import { LatheGeometry, SphereGeometry, TorusKnotGeometry, Vector2 } from "three";
import { RoundedBoxGeometry } from "three/addons/geometries/RoundedBoxGeometry.js";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

/** Radius and height of the vase from its mouth to its foot, as the command line draws it. */
const VASE = [
  [0, 0.9045], [0.1419, 0.8491], [0.187, 0.7937], [0.2108, 0.7383], [0.2225, 0.6829], [0.2065, 0.6275], [0.1896, 0.5722],
  [0.1804, 0.5168], [0.1769, 0.4614], [0.1746, 0.406], [0.1723, 0.3506], [0.1725, 0.2952], [0.1906, 0.2398], [0.24, 0.1844],
  [0.3106, 0.1291], [0.3852, 0.0737], [0.4599, 0.0183], [0.5317, -0.0371], [0.587, -0.0925], [0.6157, -0.1479],
  [0.6278, -0.2033], [0.6371, -0.2587], [0.6464, -0.314], [0.6538, -0.3694], [0.6506, -0.4248], [0.632, -0.4802],
  [0.6046, -0.5356], [0.5759, -0.591], [0.5472, -0.6464], [0.521, -0.7018], [0.5068, -0.7571], [0.509, -0.8125],
  [0.4752, -0.8679], [0.4105, -0.9045], [0, -0.9045],
];

/** Geometry by name, of any size and place. */
export const SHAPES = {
  sphere: () => new SphereGeometry(1, 64, 32),
  vase: () => toCreasedNormals(new LatheGeometry(VASE.map(([x, y]) => new Vector2(x, y)).reverse(), 96), (50 * Math.PI) / 180),
  block: () => new RoundedBoxGeometry(1.4, 1, 1.1, 6, 0.2),
  knot: () => new TorusKnotGeometry(0.65, 0.22, 192, 32),
};
