// The camera's lights for some seconds. arguments: { seconds, lights, click?, query?, screenshot?, pictures?, patience_s? };
// before it counts it waits for so many lights, and not longer than its patience. `pictures` is a folder for a picture of
// the page every half second while it counts.
// Chromium's --use-file-for-fake-video-capture gives the video. `changes` are the times at which the
// lightness of the video's top left corner was seen to change; `pictures` are the video's callbacks, each with how many
// pictures the browser had handed to the display by then; `camera` is what the camera had delivered, twice a second.

import { openPage } from "./page_steps.mjs";

export default async ({ page, context, url, arguments: given }) => {
  await context.grantPermissions(["camera"], { origin: new URL(url).origin });
  await openPage(page, url, given.query);
  await page.evaluate(() => {
    globalThis.seen = { lights: [], rates: [], changes: [], pictures: [], camera: [] };
    document.addEventListener("anyprobe-light", ({ detail: { light } }) => {
      const { direction, irradiance } = light.dominant;
      seen.lights.push({ time: performance.now() / 1000, direction, irradiance, sh9: [...light.sh9] });
    });
    const rates = document.getElementById("rates");
    const told = () => seen.rates.push({ time: performance.now() / 1000, text: rates.textContent });
    new MutationObserver(told).observe(rates, { childList: true });
    watchCorner(document.getElementById("video"));
    setInterval(() => {
      const delivered = document.getElementById("video").srcObject?.getVideoTracks()[0]?.stats?.deliveredFrames;
      if (delivered !== undefined) seen.camera.push({ time: performance.now() / 1000, delivered });
    }, 500);

    function watchCorner(video) {
      let last = null;
      const look = async (_, { presentedFrames: presented }) => {
        const time = performance.now() / 1000;
        seen.pictures.push({ time, presented });
        // the camera may have stopped meanwhile: then there is no picture to take
        if (!video.srcObject || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) return;
        const frame = new VideoFrame(video);
        const bytes = new Uint8Array(frame.allocationSize());
        const [{ offset, stride }] = await frame.copyTo(bytes); // luma; a canvas would wait for the GPU
        frame.close();
        const isLight = bytes[offset + 4 * stride + 4] > 127;
        if (last !== null && isLight !== last) seen.changes.push(time);
        last = isLight;
        if (video.srcObject) video.requestVideoFrameCallback(look);
      };
      video.requestVideoFrameCallback(look);
    }
  });
  await page.click("#camera");
  await page.waitForSelector("#rates:not([hidden])", { state: "attached" });
  if (given.click) {
    const box = await page.locator("#mask").boundingBox();
    await page.locator("#mask").click({ position: { x: given.click[0] * box.width, y: given.click[1] * box.height } });
  }
  const enough = ([count, s]) => seen.lights.length >= count || performance.now() / 1000 > s;
  const now = await page.evaluate(() => performance.now() / 1000);
  await page.waitForFunction(enough, [given.lights, now + (given.patience_s ?? Infinity)], { polling: 200 });
  await page.waitForFunction(() => document.getElementById("rates").textContent, null, { polling: 200 });
  const telling = page.evaluate(async (seconds) => {
    const from = performance.now() / 1000;
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    return { ...seen, from, to: performance.now() / 1000 };
  }, given.seconds);
  for (let count = 0; given.pictures && count < 2 * given.seconds; count++) {
    await page.screenshot({ path: `${given.pictures}/${String(count).padStart(2, "0")}.png` });
    await new Promise((done) => setTimeout(done, 500));
  }
  const told = await telling;
  told.quality = await page.textContent("#mask-quality:not([hidden])");
  if (given.screenshot) await page.screenshot({ path: given.screenshot, fullPage: true });
  await page.click("#camera");
  told.stopped = await page.evaluate(() => document.getElementById("video").srcObject === null);
  return told;
}
