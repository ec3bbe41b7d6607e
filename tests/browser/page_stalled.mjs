// A network whose file does not come. arguments: { photo, file }: held back, as Playwright's pattern, for longer than the page
// waits without a word; what it says then, and after the file has come.

import { estimated, openPage, waitForStatus } from "./page_steps.mjs";

export default async ({ page, context, url, arguments: given }) => {
  const held = [];
  await context.route(given.file, (route) => held.push(route));
  await openPage(page, url);
  await page.setInputFiles("#file", given.photo);
  const stalled = await waitForStatus(page, /^Waiting for/);
  for (const route of held) await route.continue();
  await context.unroute(given.file);
  return { stalled, then: await estimated(page) };
};
