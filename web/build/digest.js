/** One digest over everything the page is built from. */

import { createHash } from "node:crypto";
import { readFileSync, readdirSync, statSync } from "node:fs";
import { join, sep } from "node:path";

const CONTRACT = "../src/anyprobe/contract.json";
const PARTS = ["api", "build", "index.html", "package-lock.json", "package.json", "page", "src", "vite.config.js"];

/** SHA-256 over "path, length, content" of every source file, paths with / and in order. */
export function sourceDigest(web) {
  const hash = createHash("sha256");
  const files = PARTS.flatMap((part) =>
    statSync(join(web, part)).isDirectory()
      ? readdirSync(join(web, part), { recursive: true }).map((name) => join(part, name))
      : [part],
  ).filter((name) => statSync(join(web, name)).isFile());
  files.push(CONTRACT);
  for (const name of files.map((file) => file.split(sep).join("/")).sort()) {
    const content = readFileSync(join(web, name));
    hash.update(`${name} ${content.length}\n`).update(content);
  }
  return hash.digest("hex");
}
