/** The example with its result: a photo, and the server's answer for it. */

import { Light, describe } from "../src/light/light.js";
import { readSource } from "../src/photo/source.js";
import { askServer } from "./server.js";

/** Files that come with the page. */
export const fetchExample = (path) => askServer(path, { does: "has the examples", advice: "start it again, or choose a photo" });

const readPicture = async (path) => readSource(await (await fetchExample(path)).blob());

export async function readExample() {
  const [picture, maskPicture, answer] = await Promise.all([
    readPicture("example/photo.png"),
    readPicture("example/mask.png"),
    fetchExample("example/light.json").then((response) => response.json()),
  ]);
  const mask = Float32Array.from({ length: maskPicture.rgba.length / 4 }, (_, i) => maskPicture.rgba[4 * i] / 255);
  const light = new Light({
    ...describe(unpack(answer.radiance), { errorDeg: answer.dominant_light.error_deg }),
    hints: { surroundings: 0 },
    meanConfidence: answer.confidence,
    wellExposedFraction: answer.well_exposed_fraction,
    soft: answer.soft,
    outdoors: answer.outdoors,
    ground: answer.ground && { pitchDeg: answer.ground.pitch_deg, rollDeg: answer.ground.roll_deg },
  });
  return { picture, mask, longFovDeg: answer.long_fov_deg, result: { light } };
}

/** {shape, dtype: float32, base64} to numbers. */
function unpack({ base64 }) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}
