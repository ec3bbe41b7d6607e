// The page without a server behind it. arguments: { photo, folder }

import { join } from "node:path";
import { estimated, openPage } from "./page_steps.mjs";

export default async ({ page, url, arguments: given }) => {
  const elsewhere = await openPage(page, url);
  await page.setInputFiles("#file", given.photo);
  await estimated(page);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#downloads button >> text=.exr")]);
  const file = join(given.folder, download.suggestedFilename());
  await download.saveAs(file);
  return {
    elsewhere,
    file,
    isolated: await page.evaluate(() => crossOriginIsolated),
    targets_hidden: await page.isHidden("#targets"),
  };
}
