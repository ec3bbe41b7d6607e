/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-I257Zo/MzicjLaXjOvN2oJhrqCG5Ej6kPFil6o0S/v/QzUwrbgqvpP+cZAT0zaei",
  whole: "sha384-Sjzp3WGdXNhGbamBJSTPOGDC5zusyXF+BZmE+qPz5d6R/kcuIHZQP92kEQP+Lj1I",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
