/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-aJxVHi31chC8ZnIHPCvBe5nXU0bFA1PdnD9ugR7tDP48S6/aN1pK4HUTM4kdZQT+",
  whole: "sha384-opclOEzYezknoIc73Noqecq5D/GSqAQxIQq9zwSXQM+8TaT6amm30Glw1uZU4B0y",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
