// A picture of the whole page with its example, for the documentation; what its footer says.
// arguments: { picture }

import { openPage } from "./page_steps.mjs";

export default async ({ page, url, arguments: given }) => {
  await openPage(page, url);
  await page.evaluate(async () => {
    const [overlay, shape] = ["overlay", "shape"].map((id) => document.getElementById(id));
    const drawn = new Promise((resolve) => overlay.addEventListener("drawn", resolve, { once: true }));
    shape.dispatchEvent(new Event("change"));
    await drawn;
  });
  await page.screenshot({ path: given.picture, fullPage: true });
  return page.textContent("footer");
};
