// How soon and how often lights of the camera's video come. arguments: { kind: "page" | "package", threads, seconds }; for
// the package the address is of a page with its import map. first_light_s counts from the wish for the camera, the networks
// not yet fetched; megabytes are all that was fetched until then, as the server sent it.

import { openPage } from "./page_steps.mjs";

export default async ({ page, context, url, arguments: { kind, threads, seconds } }) => {
  await context.grantPermissions(["camera"], { origin: new URL(url).origin });
  let bytes = 0;
  page.on("requestfinished", async (request) => (bytes += (await request.sizes()).responseBodySize));
  if (kind === "page") {
    await openPage(page, url, `?engine=wasm&threads=${threads}`);
    await page.evaluate(() => {
      globalThis.lights = [];
      globalThis.begun = performance.now();
      document.addEventListener("anyprobe-light", () => lights.push(performance.now()));
      document.getElementById("camera").click();
    });
  } else {
    await page.goto(`${url}speed.html`);
    await page.evaluate(async (threads) => {
      globalThis.lights = [];
      globalThis.begun = performance.now();
      const { AnyProbe } = await import("anyprobe");
      const opening = AnyProbe.load({ threads });
      const video = Object.assign(document.createElement("video"), { muted: true });
      video.srcObject = await navigator.mediaDevices.getUserMedia({ video: { width: 1280, height: 720 } });
      await video.play();
      (await opening).track(video, () => lights.push(performance.now()));
    }, threads);
  }
  await page.waitForFunction(() => lights.length > 0, null, { polling: 20 });
  const loaded = bytes;
  const first = await page.evaluate(() => (lights[0] - begun) / 1000);
  await page.waitForTimeout(3000); // until the browser has compiled what runs often
  const count = await page.evaluate(async (seconds) => {
    const before = lights.length;
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    return lights.length - before;
  }, seconds);
  return { lights_per_s: count / seconds, first_light_s: first, megabytes: loaded / 1e6 };
};
