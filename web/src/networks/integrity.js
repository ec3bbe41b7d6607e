/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-I257Zo/MzicjLaXjOvN2oJhrqCG5Ej6kPFil6o0S/v/QzUwrbgqvpP+cZAT0zaei",
  whole: "sha384-PkHO/zJvGXxdvIb8gDLc3CzuH8FufJhPFS3sQf8Xqg11y5MmC0SHLR6BMNxF9wAs",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
