/** Written by integrations/write_inputs.py from the description of inputs in src/anyprobe/inputs. */

export const INPUTS = {
  mask: { about: "place" },
  click: { about: "place", unit: "px", numbers: 2, repeated: true },
  exclude: { about: "place", unit: "px", numbers: 2, repeated: true },
  box: { about: "place", unit: "px", numbers: 4 },
  longFovDeg: { about: "camera", unit: "degrees", least: 1.0, most: 170.0, numbers: 1 },
  pitchDeg: { about: "camera", unit: "degrees", least: -90, most: 90, numbers: 1 },
  normals: { about: "light" },
  material: { about: "light" },
  surroundings: { about: "light", words: ["auto", "photo", "none"] },
};
