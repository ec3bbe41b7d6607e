/** The finished example: a photo, and the server's own answer for it. */

import { describe } from "../src/light/light.js";
import { drawSpheres } from "../src/light/spheres.js";
import { readBitmap } from "./openPhoto.js";

export async function readExample() {
  const [picture, maskPicture, told] = await Promise.all([
    readPicture("example/photo.png"),
    readPicture("example/mask.png"),
    fetch("example/light.json").then((answer) => answer.json()),
  ]);
  const mask = Float32Array.from({ length: maskPicture.rgba.length / 4 }, (_, i) => maskPicture.rgba[4 * i] / 255);
  const light = describe(unpack(told.radiance));
  const { irradiance, ldr, ln_radiance: lnRadiance } = told.stages;
  const stages = { irradiance: unpack(irradiance), ldr: unpack(ldr), lnRadiance: unpack(lnRadiance) };
  const result = { light, stages, known: { surroundings: 0 }, spread: false, spheres: drawSpheres(light.radiance) };
  return { picture, mask, longFovDeg: told.long_fov_deg, result };
}

async function readPicture(path) {
  const blob = await (await fetch(path)).blob();
  return readBitmap(await createImageBitmap(blob), Infinity);
}

/** {shape, dtype: float32, base64} to numbers. */
function unpack({ base64 }) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}
