/** The networks' answers in their order. */

import { element } from "./elements.js";
import { drawFalseColor, drawFalseColorScale, drawIrradiance, drawLdr } from "./pictures.js";

export class StagesPanel {
  constructor() {
    drawFalseColorScale(element("scale"));
  }

  clear() {
    for (const id of ["irradiance", "ldr", "hdr"]) {
      const canvas = element(id);
      canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
    }
  }

  show({ irradiance, ldr }, radiance) {
    drawIrradiance(element("irradiance"), irradiance);
    drawLdr(element("ldr"), ldr);
    drawFalseColor(element("hdr"), radiance);
  }
}
