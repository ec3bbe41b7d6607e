// What the page draws of spheres, and by which light. arguments: { photo, click, materials, screenshots? }; the example, a
// photo, and the camera's picture, each { material: { width, height, rgba (base64), pose, radiance (base64) } }.

import { estimated, openPage } from "./page_steps.mjs";

/** The overlay once a material is drawn, with the light that it was drawn by. */
export function drawn(page, name) {
  return page.evaluate(async (name) => {
    const [overlay, material] = ["overlay", "material"].map((id) => document.getElementById(id));
    const base64 = (bytes) => {
      let text = "";
      for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
      return btoa(text);
    };
    // the camera's lights go on to come: the one that the next drawing begins with may be newer than the last one heard
    const lit = new Promise((resolve) => {
      overlay.addEventListener("drawn", ({ detail: pose }) => {
        const { width, height } = overlay;
        const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
        copy.drawImage(overlay, 0, 0);
        const rgba = base64(copy.getImageData(0, 0, width, height).data);
        resolve({ width, height, rgba, pose, radiance: base64(new Uint8Array(lastLight.radiance.slice().buffer)) });
      }, { once: true });
    });
    material.value = name;
    material.dispatchEvent(new Event("change"));
    return lit;
  }, name);
}

export default async ({ page, context, url, arguments: given }) => {
  await context.grantPermissions(["camera"], { origin: new URL(url).origin });
  await page.addInitScript(() => {
    document.addEventListener("anyprobe-light", ({ detail }) => (globalThis.lastLight = detail.light));
  });
  await openPage(page, url);
  const seen = {};
  const look = async (name) => {
    seen[name] = {};
    for (const material of given.materials) {
      seen[name][material] = await drawn(page, material);
      if (given.screenshots) await page.screenshot({ path: `${given.screenshots}/${name}_${material}.png`, fullPage: true });
    }
  };
  await look("example");
  await page.setInputFiles("#file", given.photo);
  await estimated(page);
  await look("photo");
  await page.evaluate(() => (globalThis.lastLight = null));
  await page.click("#camera");
  await page.waitForSelector("#rates:not([hidden])", { state: "attached" });
  const box = await page.locator("#mask").boundingBox();
  await page.locator("#mask").click({ position: { x: given.click[0] * box.width, y: given.click[1] * box.height } });
  await page.waitForFunction(() => globalThis.lastLight !== null, null, { polling: 200 });
  await look("camera");
  return seen;
};
