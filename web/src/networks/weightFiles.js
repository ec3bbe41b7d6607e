/** Address and hash of each graph in weights/, as a bundler copies them. */

import { INTEGRITY } from "./integrity.js";

export function weightFiles() {
  return {
    light: { url: new URL("../../weights/light.onnx", import.meta.url).href, integrity: INTEGRITY.light },
    mask: { url: new URL("../../weights/mask.onnx", import.meta.url).href, integrity: INTEGRITY.mask },
  };
}
