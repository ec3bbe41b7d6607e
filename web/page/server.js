/** The server of this page, which opens what browsers cannot and writes exports. */

import { problemLine } from "./words.js";

/**
 * Its answer, which is not an error.
 *
 * @param {string} path beside the page
 * @param {{does: string, advice?: string} & RequestInit} given does and advice: what it is asked for, and what to do, in the line
 *   that says that it does not answer
 */
export async function askServer(path, { does, advice = "start anyprobe serve again", ...given }) {
  const answer = await fetch(new URL(path, document.baseURI), given).catch(() => {
    throw new Error(`the server that ${does} does not answer; ${advice}`);
  });
  if (!answer.ok) throw new Error(problemLine(await answer.json().catch(() => ({ detail: `the server answers ${answer.status}` }))));
  return answer;
}
