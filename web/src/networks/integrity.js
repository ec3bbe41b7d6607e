/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-iJm/mMeU8rTx435FdV3/7o5gpw582byC0v3395m5CtjgFfRxBjOOxoGUp1TcGI8s",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
