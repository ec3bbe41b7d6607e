/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-Mhn+/Xh9kk1gOzvzk9p4wWUoVejsNRRD/yimTrZT/MWoiqMuXMhEbS7vwGd4XbqG",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
