/** Downloads: files made here, and exports that the server writes. */

import { EXPONENT, SIGMA } from "../src/core/response.js";
import { MAP_HEIGHT } from "../src/core/latlong.js";
import { encodeExr } from "../src/files/exr.js";
import { encodeHdr } from "../src/files/hdr.js";
import { brightestSide } from "../src/light/light.js";
import { askServer } from "./server.js";

const FRAME = "right-handed, +X right, +Y up, the camera looks along -Z; u = 0.5 + atan2(x, -z) / 2 pi, row 0 is +Y";
const SCALE = "linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white";

/** Version of the keys; files without one are of an older release. */
const VERSION = 4;

/** Everything but the pixels, with the keys of Light.sidecar. */
export function sidecar({ light }, { photo, model, longFovDeg }) {
  const { dominant, sources, directionality, ground, soft, outdoors, object, uncertainty, wellExposedFraction } = light;
  const { direction, irradiance, color, radiusDeg, errorDeg } = dominant;
  const solidAngleSr = 2 * Math.PI * (1 - Math.cos((radiusDeg * Math.PI) / 180));
  return asPython({
    version: VERSION,
    photo,
    model,
    longFovDeg,
    hints: { surroundings: light.hints.surroundings },
    ground,
    object,
    uncertainty,
    frame: FRAME,
    scale: SCALE,
    exposureEv: 0,
    response: { curve: "sigmoid", exponent: EXPONENT, sigma: SIGMA },
    size: [2 * MAP_HEIGHT, MAP_HEIGHT],
    confidence: light.meanConfidence,
    wellExposedFraction,
    sh9: Array.from({ length: 9 }, (_, i) => light.sh9.slice(3 * i, 3 * i + 3)),
    soft,
    outdoors,
    brightestSide: light.isSoft ? brightestSide(light) : undefined,
    dominantLight: { direction, irradiance, color, solidAngleSr, directionality, errorDeg },
    sources: sources.map(({ direction, radiusDeg, power, exists }) => ({ direction, radiusDeg, power, exists })),
  });
}

/** A value as Python has it: keys in its spelling, lists of numbers, six digits after the point. */
function asPython(value) {
  if (typeof value === "number") return Number(value.toFixed(6));
  if (value === null || typeof value !== "object") return value;
  if (Array.isArray(value) || ArrayBuffer.isView(value)) return Array.from(value, asPython);
  const spelt = (key) => key.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`);
  return Object.fromEntries(Object.entries(value).map(([key, one]) => [spelt(key), asPython(one)]));
}

/** Files that need no server: suffix to bytes. */
export const OWN_FILES = {
  exr: async ({ light }) => new Blob([await encodeExr(light.radiance, MAP_HEIGHT)], { type: "image/x-exr" }),
  hdr: ({ light }) => new Blob([encodeHdr(light.radiance, MAP_HEIGHT)], { type: "image/vnd.radiance" }),
  json: (result, about) => new Blob([`${JSON.stringify(sidecar(result, about), null, 1)}\n`], { type: "application/json" }),
};

/** An export of the server's, level where the camera's pitch is known: a zip of one target's files. */
export async function exportTarget(result, target, about) {
  const body = new FormData();
  body.append("photo", await OWN_FILES.exr(result), "light.exr");
  body.append("sidecar", OWN_FILES.json(result, about), "light.json");
  const asked = { method: "POST", body, does: "writes these files", advice: "start anyprobe serve again, or take .exr or .hdr" };
  const answer = await askServer(`v1/export/${target}`, asked);
  return answer.blob();
}

/** Hand a blob to the browser's own download. */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
