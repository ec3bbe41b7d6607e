/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-229X54CXc9psXOIhSAsJX31hBpyJy8F/uFduQW83rf6rbdgjN8LG0mxnJdDfEvk2",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
