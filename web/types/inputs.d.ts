// Written by integrations/write_inputs.py from the description of inputs in src/anyprobe/inputs.

/** A point on the object, in pixels of the photo as shown (upright, square pixels); repeatable. */
export type Click = readonly [number, number] | readonly (readonly [number, number])[];
/** Field of view of the photo's longer side, degrees; default: EXIF, else 60. 1 to 170. */
export type LongFovDeg = number;
/** How far the camera looks down, degrees: 0 level, 90 straight down. -90 to 90. */
export type PitchDeg = number;
/** Surroundings: auto (default) uses the photo around the object, unless that is cut out; photo uses it in any case; none; or a panorama in the camera's frame, transparent where unknown. */
export type Surroundings = "auto" | "photo" | "none";
