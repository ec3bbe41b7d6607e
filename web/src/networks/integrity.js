/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-+Sh0md4V9eWsUNDOg3htgU4kdssJJAOSMr61Pxy7wx9O0QZuRQB7VO2T5DVY2vqj",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
