/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-OLOkaiph085OepoQsyqvSLfGMjudIi+Q5t7vqb/MkiOBnFScqXuAEms2pStV29Z/",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
