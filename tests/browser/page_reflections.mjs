// Sharp reflections, switched on and off for the example; no arguments
// → { lost, plain, sharp, again }: what is said and ticked where the server does not answer; of each of the others the overlay
// in chrome and matte, and the little spheres as base64

import { drawn } from "./page_pixels.mjs";
import { openPage } from "./page_steps.mjs";

const spheres = (page) =>
  page.evaluate(() => Object.fromEntries(["matte", "silver", "mirror"].map((name) => [name, document.getElementById(`sphere-${name}`).toDataURL()])));

export default async ({ page, url }) => {
  await page.addInitScript(() => {
    document.addEventListener("anyprobe-light", ({ detail }) => (globalThis.lastLight = detail.light));
  });
  await openPage(page, url);
  await page.route("**/v1/detail*", (route) => route.abort());
  await page.check("#reflections");
  await page.waitForSelector("#status.fault");
  const lost = { status: await page.textContent("#status"), isTicked: await page.isChecked("#reflections") };
  await page.unroute("**/v1/detail*");
  const look = async () => ({ chrome: await drawn(page, "chrome"), matte: await drawn(page, "matte"), spheres: await spheres(page) });
  const seen = { lost, plain: await look() };
  const answered = page.waitForResponse((answer) => answer.url().includes("/v1/detail"));
  const mirror = seen.plain.spheres.mirror;
  await page.check("#reflections");
  seen.answer = (await answered).status();
  await page.waitForFunction((before) => document.getElementById("sphere-mirror").toDataURL() !== before, mirror, { polling: 200 });
  seen.sharp = await look();
  await page.uncheck("#reflections");
  await page.waitForFunction((before) => document.getElementById("sphere-mirror").toDataURL() === before, mirror, { polling: 200 });
  seen.again = await look();
  return seen;
};
