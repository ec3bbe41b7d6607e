/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-5IJKEGSXXX8Xm7DEB/UT+654VWGGGAX/91EEWJ8MKPZnbfexIBfL5Z8I6yxkenI8",
  whole: "sha384-rQt3iN5wpiycQr2VW7c4yFLXptoVsFdYQMdzbgC+KIyNrLfoWCfj/U3YA3f/9Vnv",
  mask: "sha384-V60id45AhGOuHkBCsdmMArLPD9asNwznxmHBsGmQ19A3of+l9ONJUyDvaJ3X/4li",
};
