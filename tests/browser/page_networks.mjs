// Networks that cannot be fetched at first. arguments: { photo, missing }: what is not there, one after the other, as
// Playwright's patterns; each time it comes back the photo is chosen again, in a fresh page.

import { estimated, openPage, status } from "./page_steps.mjs";

export default async ({ page, context, url, arguments: given }) => {
  const seen = {};
  for (const pattern of given.missing) {
    await context.route(pattern, (route) => route.abort());
    await openPage(page, url);
    await page.setInputFiles("#file", given.photo);
    await page.waitForSelector("#status.fault");
    seen[pattern] = [await status(page)];
    await context.unroute(pattern);
    await page.setInputFiles("#file", given.photo);
    seen[pattern].push(await estimated(page));
  }
  return seen;
};
