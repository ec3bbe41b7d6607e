/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-E9BFGibz+gbxncBDTmg5LQiV6GWj1rGA+y91+mHTwxi0Jju0+opXe2ORPoRh1OIR",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
