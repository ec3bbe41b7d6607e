// The page in a browser without WebGL. arguments: { photo }

import { estimated, openPage, status } from "./page_steps.mjs";

export default async ({ page, url, arguments: given }) => {
  await openPage(page, url);
  const seen = { first: await status(page), usable: await page.isEnabled("#shape"), shown: await page.isVisible("#overlay") };
  await page.setInputFiles("#file", given.photo);
  seen.then = await estimated(page);
  seen.direction = await page.textContent("#direction");
  return seen;
};
