// Runs one module against a headless Chromium: order as JSON on stdin, result as JSON on stdout.
//
// Order: { chromium, flags, url, steps, arguments, viewport, timeout_ms }. steps is the path of a module
// whose default export is async ({ page, context, url, arguments }) => result. What the page logs as an
// error or throws comes back as `complaints`.

import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const chunks = [];
for await (const chunk of process.stdin) chunks.push(chunk);
const order = JSON.parse(Buffer.concat(chunks).toString());
const profile = await mkdtemp(join(tmpdir(), "anyprobe-browser-"));
const complaints = [];
let context;
try {
  const { default: steps } = await import(pathToFileURL(order.steps));
  context = await chromium.launchPersistentContext(profile, {
    executablePath: order.chromium,
    args: order.flags,
    headless: true,
    viewport: order.viewport,
    acceptDownloads: true,
  });
  const page = context.pages()[0] ?? (await context.newPage());
  page.setDefaultTimeout(order.timeout_ms);
  page.on("console", (message) => {
    if (message.type() === "error") complaints.push(`${message.text()} (${message.location().url})`);
  });
  page.on("pageerror", (error) => complaints.push(String(error)));
  const result = await steps({ page, context, url: order.url, arguments: order.arguments });
  process.stdout.write(JSON.stringify({ result, complaints }));
} catch (error) {
  process.stdout.write(JSON.stringify({ error: String(error.stack ?? error), complaints }));
} finally {
  await context?.close();
  await rm(profile, { recursive: true, force: true });
}
