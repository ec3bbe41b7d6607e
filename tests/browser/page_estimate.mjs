// What the example's estimate is asked for: where to look, and how far the camera looks down; no arguments
// → { none, photo, steep, again }: of each the light's coverage, its ground, its radiance, and the pitch that is shown

import { estimated, openPage, waitForStatus } from "./page_steps.mjs";

export default async ({ page, url }) => {
  await page.addInitScript(() => {
    document.addEventListener("anyprobe-light", ({ detail }) => (globalThis.lastLight = detail.light));
  });
  await openPage(page, url);
  const ask = async (change) => {
    await page.evaluate(() => (document.getElementById("status").textContent = ""));
    await change();
    await estimated(page);
    return look();
  };
  const look = () =>
    page.evaluate(() => {
      const { hints, ground, radiance } = globalThis.lastLight;
      return { coverage: hints.surroundings, ground, radiance: [...radiance], shown: document.getElementById("pitch-value").textContent };
    });
  const seen = { none: await ask(() => page.selectOption("#surroundings", "none")) };
  seen.photo = await ask(() => page.selectOption("#surroundings", "photo"));
  seen.steep = await ask(() => page.locator("#pitch").fill("50"));
  await page.click("#example");
  await waitForStatus(page, /^This is an example/);
  seen.again = await ask(() => page.selectOption("#surroundings", "auto"));
  return seen;
};
