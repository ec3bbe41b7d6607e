/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-4BGeB2w0LMgEJoqrqQTjp0iuDBt9ezgkwAyJCTiWk++52Lhovyqb5/Ibog/yZ1Ah",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
