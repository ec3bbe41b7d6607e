/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-QU4410NSVli+SkmaJECaxzU6oV/0CzEpFbMLLn7lFjc/4+DXD+qU8R+5P9qXj4kL",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
