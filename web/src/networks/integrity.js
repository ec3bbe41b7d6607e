/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-Xspil3IFi8YYCuGubYrNiTyMkz6LkbwxrBxJEBHEC1NXEcKjZstgCXRNJpqTD+0f",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
