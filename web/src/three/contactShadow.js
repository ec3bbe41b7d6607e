/** The darkness where an object touches the ground, and how dark the shadow of the dominant light is there. */

import { DataTexture, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry, RGBAFormat } from "three";
import { luminance } from "../core/color.js";
import { irradiance } from "../light/harmonics.js";
import { shadowOpacity } from "./cameraCurve.js";

const SPOT_PX = 64;
/** Share of the radius and darkness there. */
const FALL = [[0, 1], [0.35, 0.75], [0.65, 0.25], [1, 0]];
/** No shadow takes all light away. */
const MOST_SHARE = 0.95;

/** A plane on the ground (+Y up) with a soft round spot, of side 1; scale it to a little more than the object's width. */
export class ContactShadow extends Mesh {
  /** @param {number} [opacity] in its middle */
  constructor(opacity = 0.45) {
    const material = new MeshBasicMaterial({ map: softSpot(), transparent: true, toneMapped: false, depthWrite: false, opacity });
    super(new PlaneGeometry(1, 1).rotateX(-Math.PI / 2), material);
  }

  dispose() {
    this.material.map.dispose();
    this.material.dispose();
    this.geometry.dispose();
  }
}

/**
 * Opacity of a ShadowMaterial on the ground: as dark as the dominant light's share of the ground's light is.
 *
 * @param {import("../light/light.js").Light} light
 * @param {number[]} up the ground's normal, in the light's frame
 */
export function groundShadowOpacity({ dominant, sh9 }, up) {
  const cosine = Math.max(dominant.direction.reduce((sum, value, i) => sum + value * up[i], 0), 0);
  const ofDominant = luminance(...dominant.irradiance) * cosine;
  const ofAll = Math.max(luminance(...irradiance(sh9, up)), ofDominant, 1e-6);
  return shadowOpacity(Math.min(ofDominant / ofAll, MOST_SHARE));
}

/** Black, darkest in its middle. */
function softSpot() {
  const data = new Uint8Array(4 * SPOT_PX * SPOT_PX);
  for (let i = 0; i < SPOT_PX * SPOT_PX; i++) {
    const [x, y] = [(i % SPOT_PX) + 0.5, Math.floor(i / SPOT_PX) + 0.5].map((value) => (2 * value) / SPOT_PX - 1);
    data[4 * i + 3] = 255 * darkness(Math.hypot(x, y));
  }
  const texture = new DataTexture(data, SPOT_PX, SPOT_PX, RGBAFormat);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function darkness(radius) {
  const next = FALL.findIndex(([place]) => place >= radius);
  if (next < 0) return 0;
  if (next === 0) return FALL[0][1];
  const [[from, dark], [to, light]] = [FALL[next - 1], FALL[next]];
  return dark + ((light - dark) * (radius - from)) / (to - from);
}
