// The exposure of the light's previews, for the example; no arguments
// → { plain, darker, again }: of each the mean display value of map and spheres, and the photo as text

import { openPage } from "./page_steps.mjs";

const PREVIEWS = ["map", "sphere-matte", "sphere-silver", "sphere-mirror"];

/** Means of what is covered. */
const look = (page) =>
  page.evaluate((ids) => {
    const meanOf = (canvas) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let [sum, count] = [0, 0];
      for (let i = 0; i < data.length; i += 4) {
        if (data[i + 3] !== 255) continue;
        sum += (data[i] + data[i + 1] + data[i + 2]) / 3;
        count++;
      }
      return sum / count;
    };
    const previews = Object.fromEntries(ids.map((id) => [id, meanOf(document.getElementById(id))]));
    return { ...previews, photo: ["photo", "overlay"].map((id) => document.getElementById(id).toDataURL()).join() };
  }, PREVIEWS);

/** Do something, and wait until the object is drawn anew. */
async function andDrawn(page, work) {
  await page.evaluate(() => {
    globalThis.isDrawn = false;
    document.getElementById("overlay").addEventListener("drawn", () => (globalThis.isDrawn = true), { once: true });
  });
  await work();
  await page.waitForFunction(() => globalThis.isDrawn, null, { polling: 100 });
}

export default async ({ page, url }) => {
  await openPage(page, url);
  const expose = (ev) => page.locator("#exposure").fill(String(ev));
  await andDrawn(page, () => page.selectOption("#material", "gold"));
  const seen = { plain: await look(page) };
  await expose(-3);
  seen.darker = await look(page);
  await expose(0);
  seen.again = await look(page);
  return seen;
};
