/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-DKSRpfcXy9K9Q8o6FDQyxLoQ3ee7zWIgYAY4PZ63keXvs3XzwHdjcB90Awl0zOXr",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
