/** Downloads: files made here, and exports that the server writes. */

import { EXPONENT, SIGMA } from "../src/core/response.js";
import { MAP_HEIGHT } from "../src/core/latlong.js";
import { encodeExr } from "../src/files/exr.js";
import { encodeHdr } from "../src/files/hdr.js";
import { brightestSide } from "../src/light/light.js";
import { askServer } from "./server.js";

const FRAME =
  "right-handed, +X right, +Y up, the camera looks along -Z; u = 0.5 + atan2(x, -z) / 2 pi, row 0 is +Y";
const SCALE =
  "linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white";

/** Version of the keys; files without one are of an older release. */
const VERSION = 4;

const numbers = (values) => Array.from(values, (value) => Number(value.toFixed(6)));

/** Everything but the pixels, with the keys of Light.sidecar. */
export function sidecar(result, { photo, model, longFovDeg }) {
  const { sh9, sources, dominant, directionality, hints, ground, soft, outdoors, wellExposedFraction, meanConfidence, object, uncertainty } = result.light;
  return {
    version: VERSION,
    photo,
    model,
    long_fov_deg: longFovDeg,
    hints: { surroundings: Number(hints.surroundings.toFixed(4)) },
    ground: ground && {
      pitch_deg: Number(ground.pitchDeg.toFixed(2)),
      pitch_error_deg: Number(ground.pitchErrorDeg.toFixed(2)),
      roll_deg: Number(ground.rollDeg.toFixed(2)),
      contact: ground.contact.map((value) => Number(value.toFixed(1))),
      source: ground.source,
    },
    object: object && {
      metal: Number(object.metal.toFixed(3)),
      reflectance: object.reflectance.map((value) => Number(value.toFixed(3))),
      reflectance_stops: Number(object.reflectanceStops.toFixed(2)),
    },
    uncertainty: uncertainty && {
      level_stops: Number(uncertainty.levelStops.toFixed(2)),
      color_deg: Number(uncertainty.colorDeg.toFixed(1)),
    },
    frame: FRAME,
    scale: SCALE,
    exposure_ev: 0,
    response: { curve: "sigmoid", exponent: EXPONENT, sigma: SIGMA },
    size: [2 * MAP_HEIGHT, MAP_HEIGHT],
    confidence: meanConfidence && Number(meanConfidence.toFixed(4)),
    well_exposed_fraction: Number(wellExposedFraction.toFixed(4)),
    sh9: Array.from({ length: 9 }, (_, i) => numbers(sh9.slice(3 * i, 3 * i + 3))),
    ...(soft === undefined ? {} : { soft: Number(soft.toFixed(3)) }),
    ...(outdoors === undefined ? {} : { outdoors: Number(outdoors.toFixed(3)) }),
    ...(result.light.isSoft ? { brightest_side: brightestSide(result.light) } : {}),
    dominant_light: {
      direction: numbers(dominant.direction),
      irradiance: numbers(dominant.irradiance),
      color: numbers(dominant.color),
      solid_angle_sr: Number((2 * Math.PI * (1 - Math.cos((dominant.radiusDeg * Math.PI) / 180))).toFixed(5)),
      directionality: Number(directionality.toFixed(4)),
      error_deg: Number(dominant.errorDeg.toFixed(1)),
    },
    sources: sources.map(({ direction, radiusDeg, power, exists }) => ({
      direction: numbers(direction),
      radius_deg: Number(radiusDeg.toFixed(2)),
      power: numbers(power),
      exists: Number(exists.toFixed(3)),
    })),
  };
}

/** Files that need no server: suffix to bytes. */
export const OWN_FILES = {
  exr: async ({ light }) => new Blob([await encodeExr(light.radiance, MAP_HEIGHT)], { type: "image/x-exr" }),
  hdr: ({ light }) => new Blob([encodeHdr(light.radiance, MAP_HEIGHT)], { type: "image/vnd.radiance" }),
  json: (result, about) =>
    new Blob([`${JSON.stringify(sidecar(result, about), null, 1)}\n`], { type: "application/json" }),
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
