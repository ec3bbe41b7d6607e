/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-drcyd3kuRDwCc8wJLWlSQqOUAri2c+0g6tDsdfaCoTR8q1nnsYKn5wAo5vEoiI3x",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
