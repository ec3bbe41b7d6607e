/** Read the lens from a photo's Exif. */

/** First bytes of Exif in JPEG, PNG, WebP, HEIC or AVIF, as of TIFF: its byte order and 42. */
const BEGINNING = /(?:Exif\0\0|eXIf|EXIF[^]{4})(II\*\0|MM\0\*)/;

const [EXIF_FOLDER, FOCAL_35_MM] = [0x8769, 0xa405];

/** Focal lengths that a lens can have, mm on 36 mm of film. */
const [LEAST_MM, MOST_MM] = [2, 2000];

/**
 * Field of view of the longer side [degrees], 2 atan(18 / f), from the 35 mm equivalent; null if the file does not state it.
 *
 * @param {Blob} blob
 * @returns {Promise<number | null>}
 */
export async function exifFovDeg(blob) {
  const bytes = new DataView(await blob.arrayBuffer());
  const found = BEGINNING.exec(new TextDecoder("latin1").decode(bytes));
  if (!found) return null;
  try {
    const view = new DataView(bytes.buffer, found.index + found[0].length - 4);
    const isLittle = found[1].startsWith("II");
    const at = valueOf(view, view.getUint32(4, isLittle), EXIF_FOLDER, isLittle);
    const focal = at === null ? null : valueOf(view, at, FOCAL_35_MM, isLittle);
    return focal >= LEAST_MM && focal <= MOST_MM ? (Math.atan(18 / focal) * 360) / Math.PI : null;
  } catch {
    return null; // it is damaged: an offset lies outside
  }
}

/** The number of a tag, 16 bits (type 3) or 32, in the folder at an offset; null without it. */
function valueOf(view, folder, tag, isLittle) {
  const count = view.getUint16(folder, isLittle);
  for (let at = folder + 2; at < folder + 2 + 12 * count; at += 12) {
    if (view.getUint16(at, isLittle) !== tag) continue;
    return view.getUint16(at + 2, isLittle) === 3 ? view.getUint16(at + 8, isLittle) : view.getUint32(at + 8, isLittle);
  }
  return null;
}
