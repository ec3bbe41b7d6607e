/** Notices: what is doubtful, as data; anyprobe.notices has the same. A page or plug-in may put them into its own words. */

/**
 * @typedef {object} Notice
 * @property {string} code what it is, for programs: docs/reference/errors.md
 * @property {string} text without the names of options
 * @property {{do: "give" | "leave out", name: string, value?: string}[]} remedy options to give, any of them
 */

/** @param {string} code @param {string} text @param {Notice["remedy"]} [remedy] @returns {Notice} */
export const notice = (code, text, remedy = []) => ({ code, text, remedy });

/** Options to give, as a remedy. @param {...string} names */
export const give = (...names) => names.map((name) => ({ do: "give", name }));

/** One line in the package's words. @param {Notice} found */
export function lineOf({ text, remedy }) {
  const names = remedy.map(({ name, value }) => (value ? `${name} "${value}"` : name));
  const last = names.pop();
  return last === undefined ? text : `${text}; give ${names.length ? `${names.join(", ")} or ${last}` : last}`;
}

/** Warnings of the networks' thread as notices, and as lines. @param {(Notice | string)[]} [warnings] */
export function described(warnings = []) {
  const notices = warnings.map((one) => (typeof one === "string" ? notice("doubt", one) : one));
  return { notices, warnings: notices.map(lineOf) };
}
