/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-r4hUUH/vYNuT0iS5ZckLyAdfVz8ZpZaeFrHlHCXEpbPg22PtwmmEjnz/G+eWrrzP",
  whole: "sha384-IRr080rUYzoSa2p1IcGdGzzlFr7wr/Jmo/0wavFG2/7nkyvRlcSopAj92A9seADv",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
