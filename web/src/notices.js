/** Notices: errors and doubts as data, worded by each door in its own names; as anyprobe.notices. */

/**
 * @typedef {object} Notice
 * @property {string} code what it is, for programs: docs/reference/errors.md
 * @property {string[]} subject options concerned
 * @property {string} text what was expected and what came, without the names of options
 * @property {{do: "give" | "leave out" | "run", name: string, value?: string}[]} remedy any of them mends it
 */

/** @param {string} code @param {string} text @param {Notice["remedy"]} [remedy] @param {string[]} [subject] @returns {Notice} */
export const notice = (code, text, remedy = [], subject = []) => ({ code, subject, text, remedy });

/** Options to give, as a remedy. @param {...string} names */
export const give = (...names) => names.map((name) => ({ do: "give", name }));

const either = (names) => (names.length > 1 ? `${names.slice(0, -1).join(", ")} or ${names.at(-1)}` : names[0]);

/** How a door names options: here as the package's. Other doors override name, giving, leavingOut or action. */
export class Words {
  /** What users call an option; null: it is not theirs. @param {string} option */
  name(option) {
    return option;
  }

  /** How users give one of these options; null: they cannot. @param {{name: string, value?: string}[]} options */
  giving(options) {
    return `give ${either(options.map(({ name, value }) => (value ? `${name} "${value}"` : name)))}`;
  }

  /** How users leave one of these options out; null: they cannot. @param {{name: string}[]} options */
  leavingOut(options) {
    return `leave out ${either(options.map(({ name }) => name))}`;
  }

  /** What users do for an action; null: they cannot. @param {string} _name */
  action(_name) {
    return null;
  }

  /** A notice as one line. @param {Partial<Notice>} found */
  line({ subject = [], text, remedy = [] }) {
    const names = subject.map((one) => this.name(one)).filter(Boolean);
    const which = (kind) => remedy.filter((one) => one.do === kind);
    const [given, left] = [which("give"), which("leave out")];
    const ways = [given.length && this.giving(given), left.length && this.leavingOut(left)].filter(Boolean).join(", or ");
    const advice = [ways, ...which("run").map(({ name }) => this.action(name))];
    return [names.length ? `${names.join(" and ")}: ${text}` : text, ...advice.filter(Boolean)].join("; ");
  }
}

export const PACKAGE = new Words();

/** Warnings of the networks' thread as notices, and as lines. @param {(Notice | string)[]} [warnings] */
export function described(warnings = []) {
  const notices = warnings.map((one) => (typeof one === "string" ? notice("doubt", one) : one));
  return { notices, warnings: notices.map((one) => PACKAGE.line(one)) };
}
