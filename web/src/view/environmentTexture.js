/** Our map as three.js's environment: turned into its layout, prefiltered, one texture used again. */

import { DataTexture, EquirectangularReflectionMapping, FloatType, LinearFilter, PMREMGenerator, RGBAFormat } from "three";
import { MAP_HEIGHT } from "../core/latlong.js";

const WIDTH = 2 * MAP_HEIGHT;
/** Half floats end here; three.js prefilters into them. */
const HALF_MAX = 65504;

export class EnvironmentTexture {
  constructor(renderer) {
    this.generator = new PMREMGenerator(renderer);
    this.data = new Float32Array(4 * WIDTH * MAP_HEIGHT);
    this.source = new DataTexture(this.data, WIDTH, MAP_HEIGHT, RGBAFormat, FloatType);
    this.source.mapping = EquirectangularReflectionMapping;
    this.source.minFilter = this.source.magFilter = LinearFilter;
    this.target = null;
  }

  /** The prefiltered texture of a map; the last one is overwritten. */
  update(radiance) {
    fillThreeLayout(radiance, this.data);
    this.source.needsUpdate = true;
    this.target = this.generator.fromEquirectangular(this.source, this.target);
    return this.target.texture;
  }
}

/**
 * Ours to three.js's: u = 0.5 + atan2(z, x) / 2 pi, so a quarter of the columns roll to the left;
 * its first row is the lowest.
 */
export function fillThreeLayout(radiance, rgba) {
  for (let row = 0; row < MAP_HEIGHT; row++) {
    for (let column = 0; column < WIDTH; column++) {
      const from = 3 * (row * WIDTH + ((column + WIDTH / 4) % WIDTH));
      const to = 4 * ((MAP_HEIGHT - 1 - row) * WIDTH + column);
      for (let c = 0; c < 3; c++) rgba[to + c] = Math.min(radiance[from + c], HALF_MAX);
      rgba[to + 3] = 1;
    }
  }
}
