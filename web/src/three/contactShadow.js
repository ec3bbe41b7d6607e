/** The darkness where an object touches the ground. */

import { DataTexture, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry, RGBAFormat } from "three";

const SPOT_PX = 64;

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

/** Black, most opaque in the middle. */
function softSpot() {
  const data = new Uint8Array(4 * SPOT_PX * SPOT_PX);
  for (let i = 0; i < SPOT_PX * SPOT_PX; i++) {
    const [x, y] = [(i % SPOT_PX) + 0.5, Math.floor(i / SPOT_PX) + 0.5].map((value) => (2 * value) / SPOT_PX - 1);
    data[4 * i + 3] = 127.5 * (1 + Math.cos(Math.PI * Math.min(Math.hypot(x, y), 1)));
  }
  const texture = new DataTexture(data, SPOT_PX, SPOT_PX, RGBAFormat);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
