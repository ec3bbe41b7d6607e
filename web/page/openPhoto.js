/** Open files, pasted pictures and addresses as pictures in memory. */

import { DEFAULT_LONG_FOV_DEG } from "../src/photo/lens.js";
import { readSource } from "../src/photo/source.js";
import { askServer } from "./server.js";

/**
 * @typedef {object} Opened
 * @property {import("../src/photo/picture.js").Picture} picture
 * @property {number} longFovDeg from EXIF, else that of a phone
 * @property {number | null} lensDeg the same, null where EXIF does not say
 * @property {string} name without its suffix
 */

/**
 * Open a photo; what this browser cannot decode (HEIC, TIFF, EXR) the server turns into PNG.
 *
 * @param {Blob} blob
 * @param {string} name
 * @param {boolean} hasServer
 * @returns {Promise<Opened>}
 */
export async function openPhoto(blob, name, hasServer) {
  if (blob.size === 0) throw new Error(`${name} is empty; copy it again`);
  const opened = await readSource(blob).catch(async () => {
    const converted = await throughServer(blob, name, hasServer);
    return { ...(await readSource(converted.blob)), exifFovDeg: converted.longFovDeg };
  });
  const { exifFovDeg: lensDeg, ...picture } = opened;
  return { picture, longFovDeg: lensDeg ?? DEFAULT_LONG_FOV_DEG, lensDeg, name: name.replace(/\.[^.]*$/, "") };
}

async function throughServer(blob, name, hasServer) {
  if (!hasServer) throw new Error(`${name}: this browser cannot open it as a picture. Choose a photo, or save it as JPEG or PNG first.`);
  const body = new FormData();
  body.append("photo", blob, name);
  const asked = { method: "POST", body, does: "opens this kind of file", advice: "start anyprobe serve again, or choose a JPEG or PNG" };
  const answer = await askServer("v1/photo", asked).catch((error) => {
    throw new Error(`${name}: ${error.message}`);
  });
  const given = answer.headers.get("X-Long-Fov-Deg");
  return { blob: await answer.blob(), longFovDeg: given === null ? null : Number(given) };
}
