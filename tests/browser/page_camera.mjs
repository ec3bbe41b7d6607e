// The camera's lights for some seconds. arguments: { seconds, click, lights?, screenshot? };
// first it waits for so many lights (3), however long they take.
// Chromium's --use-file-for-fake-video-capture gives the video.

import { openPage } from "./page_steps.mjs";

export default async ({ page, context, url, arguments: given }) => {
  await context.grantPermissions(["camera"], { origin: new URL(url).origin });
  await openPage(page, url, given.query ?? "?engine=wasm");
  await page.evaluate(() => {
    globalThis.seen = [];
    document.addEventListener("anyprobe-light", ({ detail: { light, ms } }) => {
      const { direction, irradiance } = light.mainLight;
      seen.push({ time: performance.now() / 1000, ms, direction, irradiance, sh9: [...light.sh9] });
    });
  });
  await page.click("#camera");
  await page.waitForSelector("#rates:not([hidden])", { state: "attached" });
  if (given.click) {
    const box = await page.locator("#mask").boundingBox();
    await page.locator("#mask").click({ position: { x: given.click[0] * box.width, y: given.click[1] * box.height } });
  }
  await page.waitForFunction((count) => seen.length >= count, given.lights ?? 3, { polling: 200 });
  await page.waitForFunction(() => document.getElementById("rates").textContent, null, { polling: 200 });
  const told = await page.evaluate(async (seconds) => {
    const start = performance.now() / 1000;
    let frames = 0;
    const count = () => (frames++, requestAnimationFrame(count));
    requestAnimationFrame(count);
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    const took = performance.now() / 1000 - start;
    const lights = seen.filter(({ time }) => time > start);
    return { all: seen, lights, took, frames, rates: document.getElementById("rates").textContent };
  }, given.seconds);
  if (given.screenshot) await page.screenshot({ path: given.screenshot, fullPage: true });
  await page.click("#camera");
  told.stopped = await page.evaluate(() => document.getElementById("video").srcObject === null);
  return told;
}
