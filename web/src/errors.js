/** Errors: one line of text, and a code for programs. */

import { PACKAGE, notice } from "./notices.js";

/**
 * `code` is one of
 *
 *   invalid-option  an option of a name, kind or range that there is not
 *   invalid-image   nothing that holds a picture, or a picture without pixels
 *   no-object       no object is marked, or it is too small
 *   unsupported     the browser lacks what is needed
 *   fetch-failed    a file could not be fetched, is not the one expected, or stalls
 *   worker-failed   the networks' thread could not be started, or ended
 *   disposed        asked of a probe after dispose()
 *   failed          anything else: a camera that ends, or a fault of this package
 */
export class AnyProbeError extends Error {
  /**
   * @param {string} code
   * @param {string} text without the names of options
   * @param {{subject?: string[], remedy?: import("./notices.js").Notice["remedy"], cause?: unknown}} [about]
   */
  constructor(code, text, { subject, remedy, ...options } = {}) {
    const found = notice(code, text, remedy, subject);
    super(PACKAGE.line(found), options);
    this.name = "AnyProbeError";
    this.code = code;
    this.notice = found;
  }
}

/** An error as plain data, to be sent to another thread. */
export const sentError = (error) => error.notice ?? notice(error.code ?? "failed", error.message ?? String(error));

/** The error of such data. */
export const receivedError = ({ code, text, subject, remedy }) => new AnyProbeError(code, text, { subject, remedy });

/** What pixels are read by; of a picture of another origin an error that says what to do. @template T @param {() => T} read @param {string} name @returns {T} */
export function readable(read, name) {
  try {
    return read();
  } catch (error) {
    if (error?.name !== "SecurityError") throw error;
    throw foreign(name);
  }
}

/** Of a picture of another origin. @param {string} name */
export function foreign(name) {
  return new AnyProbeError("invalid-image", `expected pixels that this page may read, got those of another origin; set crossOrigin`, { subject: [name] });
}
