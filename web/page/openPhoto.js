/** Open files, pasted pictures and addresses as pictures in memory. */

import { exifFovDeg } from "../src/files/exif.js";
import { DEFAULT_LONG_FOV_DEG } from "../src/photo/lens.js";
import { askServer } from "./server.js";

/** Longer side to which a photo is shrunk: more than is shown, and ample for a crop of 128. */
export const LONG_PX = 1600;

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
  let longFovDeg = await exifFovDeg(blob);
  let bitmap;
  try {
    bitmap = await createImageBitmap(blob, { imageOrientation: "from-image" });
  } catch {
    const converted = await throughServer(blob, name, hasServer);
    longFovDeg = converted.longFovDeg ?? longFovDeg;
    bitmap = await createImageBitmap(converted.blob);
  }
  const picture = readBitmap(bitmap, LONG_PX);
  return { picture, longFovDeg: longFovDeg ?? DEFAULT_LONG_FOV_DEG, lensDeg: longFovDeg, name: name.replace(/\.[^.]*$/, "") };
}

/** Pixels of a bitmap, shrunk to a longer side; the bitmap is closed. */
export function readBitmap(bitmap, longPx) {
  const scale = Math.min(1, longPx / Math.max(bitmap.width, bitmap.height));
  const width = Math.max(1, Math.round(bitmap.width * scale));
  const height = Math.max(1, Math.round(bitmap.height * scale));
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.imageSmoothingQuality = "high";
  context.drawImage(bitmap, 0, 0, width, height);
  bitmap.close();
  return { width, height, rgba: context.getImageData(0, 0, width, height).data };
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
