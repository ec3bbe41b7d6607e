/** What the light's graph says of an even map, for tests without networks; what is given replaces it. */
export const said = (level, given = {}) => ({
  radiance: new Float32Array(64 * 128 * 3).fill(level),
  confidence: new Float32Array(64 * 128).fill(0.5),
  errors: [20, 0.5, 5],
  posture: [20, 0, 5],
  soft: [0],
  outdoors: [0.5],
  believed: [1],
  field_of_view: [60, 5],
  well_exposed: [1],
  object_material: [0, 0.5, 0.5, 0.5, 0.5],
  seen: new Float32Array(64 * 128 * 4),
  ...given,
});
