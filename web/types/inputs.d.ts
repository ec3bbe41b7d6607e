/** Written by integrations/write_inputs.py from the description of inputs in src/anyprobe/inputs. */

import type { GivenMaterial } from "./index.js";

export interface Hints {
  /** A point on the object, in pixels of the photo as shown (upright, square pixels); repeatable. */
  click?: readonly [number, number] | readonly (readonly [number, number])[] | null;
  /** A point that is not on the object, in pixels as the click; repeatable. */
  exclude?: readonly [number, number] | readonly (readonly [number, number])[] | null;
  /** Box around the object, in pixels of the photo as shown (upright, square pixels). */
  box?: readonly [number, number, number, number] | null;
}

export interface LightOptions {
  /** How far the camera looks down, degrees: 0 level, 90 straight down. -90 to 90. */
  pitchDeg?: number;
  /** The object's material: chrome, gold, plastic, matte (albedo 0.3) or a measured one (anyprobe materials). */
  material?: GivenMaterial;
  /** Surroundings: auto (default) uses the photo around the object, unless that is cut out; photo uses it in any case; none; or a panorama in the camera's frame, transparent where unknown. */
  surroundings?: "auto" | "photo" | "none" | boolean;
}
