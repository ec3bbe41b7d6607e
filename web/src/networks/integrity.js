/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-r4hUUH/vYNuT0iS5ZckLyAdfVz8ZpZaeFrHlHCXEpbPg22PtwmmEjnz/G+eWrrzP",
  whole: "sha384-Dw8+8KhYXa9//LrdGZzW6GnHMbEbAOTDVukRbZLlE0R2WPpdIhgF6p7gy9nhGl3M",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
