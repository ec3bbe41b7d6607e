// The real photo among the examples: → { outline, credit }

import { estimated, openPage, outlined } from "./page_steps.mjs";

export default async ({ page, url }) => {
  await openPage(page, url);
  await page.click("#example-teapot");
  await estimated(page);
  return { outline: await outlined(page), credit: await page.textContent("footer") };
};
