/** The light's blurred levels as three.js's environment: one cube texture, used again for every light. */

import { CompressedCubeTexture, DataUtils, HalfFloatType, LinearFilter, LinearMipmapLinearFilter, REVISION, RGBAFormat } from "three";
import { AnyProbeError } from "../errors.js";
import { FACE_SIZES } from "../light/prefilter.js";

/** Older versions read prefiltered cubes differently and shade diffuse surfaces wrongly, 181 black. */
const LEAST_REVISION = 187;

export class EnvironmentTexture {
  #sizes;

  /** @param {number[]} [sizes] of the faces, sharpest first */
  constructor(sizes = FACE_SIZES) {
    this.#sizes = sizes;
    if (!(Number.parseInt(REVISION, 10) >= LEAST_REVISION)) {
      throw new AnyProbeError("unsupported", `three.js: expected revision ${LEAST_REVISION} or newer, got ${REVISION}; older ones shade diffuse surfaces wrongly under this texture`);
    }
    // "compressed" is what three.js calls every cube whose levels are given; these are plain half floats
    const faces = Array.from({ length: 6 }, () => ({
      width: sizes[0],
      height: sizes[0],
      mipmaps: sizes.map((size) => ({ width: size, height: size, data: new Uint16Array(4 * size * size) })),
    }));
    this.texture = new CompressedCubeTexture(faces, RGBAFormat, HalfFloatType);
    this.texture.isPMREMTexture = true;
    this.texture.userData.isWholeLight = true;
    this.texture.minFilter = LinearMipmapLinearFilter;
    this.texture.magFilter = LinearFilter;
  }

  dispose() {
    this.texture.dispose();
  }

  /** @param {Float32Array[]} levels `prefiltered` of a light; the last ones are overwritten */
  update(levels) {
    if (!this.#sizes.every((size, level) => levels?.[level]?.length === 24 * size * size)) {
      throw new AnyProbeError("invalid-option", `expected light.prefiltered, ${this.#sizes.length} levels of six faces, got others`, { subject: ["levels"] });
    }
    levels.forEach((values, level) => {
      const count = values.length / 6;
      this.texture.image.forEach(({ mipmaps }, face) => {
        const { data } = mipmaps[level];
        for (let i = 0; i < count; i++) data[i] = DataUtils.toHalfFloat(values[face * count + i]);
      });
    });
    this.texture.needsUpdate = true;
    return this.texture;
  }
}
