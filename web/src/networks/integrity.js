/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-n35koX92vVm/0X57fDvpVbl/0qw0j8d4hNhEDTInM3Y1+FKnpaiURP7JL8I5wQ8e",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
