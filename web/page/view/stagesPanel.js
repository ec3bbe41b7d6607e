/** The networks' answers in their order. */

import { element } from "./elements.js";
import { drawFalseColor, drawFalseColorScale, drawIrradiance, drawMap } from "./pictures.js";

export class StagesPanel {
  constructor() {
    drawFalseColorScale(element("scale"));
  }

  /** Empty pictures are not shown. */
  clear() {
    element("steps").hidden = true;
    for (const id of ["irradiance", "ldr", "hdr"]) {
      const canvas = element(id);
      canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
    }
  }

  show({ irradiance }, radiance) {
    element("steps").hidden = false;
    drawIrradiance(element("irradiance"), irradiance);
    drawMap(element("ldr"), radiance, 0);
    drawFalseColor(element("hdr"), radiance);
  }
}
