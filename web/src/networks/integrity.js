/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-r4hUUH/vYNuT0iS5ZckLyAdfVz8ZpZaeFrHlHCXEpbPg22PtwmmEjnz/G+eWrrzP",
  whole: "sha384-/rzffX8csTlh8Na0aW6331O5n9L1NtkeDU5+w59MgDvFhJt31g3R3FFeTjzfxh70",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
