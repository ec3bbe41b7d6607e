/** Suggest known names for an unknown one, by the rule of anyprobe.core.spelling. */

import { CONTRACT } from "./core/contract.js";

const { least_likeness: LEAST_LIKENESS, most: MOST, least_part: LEAST_PART } = CONTRACT.spelling;

/** "; did you mean gold?" with known names that are like an unknown one or contain it, whatever their case; "" without any. */
export function didYouMean(name, known) {
  if (typeof name !== "string") return "";
  const key = name.trim().toLowerCase();
  const names = known.map((one) => ({ one, lower: String(one).toLowerCase() }));
  const rated = names.map(({ one, lower }) => ({ one, likeness: likeness(lower, key) })).filter((one) => one.likeness >= LEAST_LIKENESS);
  rated.sort((a, b) => b.likeness - a.likeness || (a.one < b.one ? 1 : -1));
  const parts = key.length >= LEAST_PART ? names.filter(({ lower }) => lower.includes(key)) : [];
  const alike = (rated.length ? rated : parts).slice(0, MOST).map(({ one }) => one);
  return alike.length ? `; did you mean ${alike.join(" or ")}?` : "";
}

/** The ratio of difflib's SequenceMatcher; 0 where the lengths alone keep it below what counts. */
function likeness(a, b) {
  const half = (a.length + b.length) / 2;
  return Math.min(a.length, b.length) < LEAST_LIKENESS * half ? 0 : matching(a, b) / half;
}

/** Letters of the longest common piece, the first of several, and of those before and after it. */
function matching(a, b) {
  let [size, fromA, fromB, before] = [0, 0, 0, []];
  for (let i = 0; i < a.length; i++) {
    const here = [];
    for (let j = 0; j < b.length; j++) {
      if (a[i] !== b[j]) continue;
      here[j] = (before[j - 1] ?? 0) + 1;
      if (here[j] > size) [size, fromA, fromB] = [here[j], i - here[j] + 1, j - here[j] + 1];
    }
    before = here;
  }
  if (size === 0) return 0;
  return size + matching(a.slice(0, fromA), b.slice(0, fromB)) + matching(a.slice(fromA + size), b.slice(fromB + size));
}
