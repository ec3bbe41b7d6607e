/** Sharp reflections: the server's plausible detail on the page's own map, for what mirrors. */

import { MAP_HEIGHT } from "../src/core/latlong.js";
import { encodeExr } from "../src/files/exr.js";
import { decodeHdr } from "../src/files/hdr.js";
import { prefilterSharp } from "../src/light/prefilter.js";
import { askServer } from "./server.js";

/** As fine as the faces of a cube that stands in for it. */
const ROWS = 256;

/**
 * @typedef {object} Reflections
 * @property {Float32Array} radiance [height, 2 height, 3]
 * @property {number} height
 * @property {Float32Array[]} levels of prefilterSharp
 */

/**
 * @param {import("../src/light/light.js").Light} light whose map, and confidence where there is one, the server gets
 * @returns {Promise<Reflections>}
 */
export async function askReflections({ radiance, confidence, prefiltered }) {
  const body = new FormData();
  body.append("photo", new Blob([await encodeExr(radiance, MAP_HEIGHT)]), "map.exr");
  if (confidence) {
    const grey = Float32Array.from({ length: radiance.length }, (_, i) => confidence[Math.floor(i / 3)]);
    body.append("confidence", new Blob([await encodeExr(grey, MAP_HEIGHT)]), "confidence.exr");
  }
  const answer = await askServer(`v1/detail?format=hdr&size=${ROWS}`, { method: "POST", body, does: "adds sharp reflections" });
  const found = decodeHdr(new Uint8Array(await answer.arrayBuffer()));
  return { ...found, levels: prefilterSharp(found.radiance, found.height, prefiltered) };
}
