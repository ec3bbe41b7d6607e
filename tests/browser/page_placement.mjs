// Where the virtual object stands by default. arguments: { photos, glb, screenshots? }; for each photo and shape, what of
// the overlay is opaque, that is the object without its shadow: left, top, right, bottom as shares; and the same after it
// was moved over the border by keys.

import { estimated, openPage } from "./page_steps.mjs";

/** Bounds of the opaque pixels of a shape, once it is drawn. */
function covered(page, name) {
  return page.evaluate(async (name) => {
    const [overlay, shape] = ["overlay", "shape"].map((id) => document.getElementById(id));
    const drawn = new Promise((resolve) => overlay.addEventListener("drawn", resolve, { once: true }));
    shape.value = name;
    shape.dispatchEvent(new Event("change"));
    await drawn;
    const { width, height } = overlay;
    const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    copy.drawImage(overlay, 0, 0);
    const { data } = copy.getImageData(0, 0, width, height);
    let [x0, y0, x1, y1] = [width, height, 0, 0];
    for (let i = 0; i < width * height; i++) {
      if (data[4 * i + 3] < 255) continue;
      const [x, y] = [i % width, Math.floor(i / width)];
      [x0, y0, x1, y1] = [Math.min(x0, x), Math.min(y0, y), Math.max(x1, x + 1), Math.max(y1, y + 1)];
    }
    return [x0 / width, y0 / height, x1 / width, y1 / height];
  }, name);
}

export default async ({ page, url, arguments: given }) => {
  await openPage(page, url);
  await page.setInputFiles("#model-file", given.glb);
  await page.waitForFunction(() => document.getElementById("shape").value === "own", null, { polling: 200 });
  const seen = {};
  for (const [name, photo] of Object.entries(given.photos)) {
    await page.evaluate(() => (document.getElementById("status").textContent = ""));
    await page.setInputFiles("#file", photo);
    await estimated(page);
    seen[name] = {};
    for (const shape of ["sphere", "vase", "block", "own"]) {
      const box = await covered(page, shape);
      seen[name][shape] = { box, note: await page.textContent("#place-note") };
      if (given.screenshots) await page.locator("#frame").screenshot({ path: `${given.screenshots}/${name}_${shape}.png` });
    }
  }
  await page.focus("#overlay");
  for (let i = 0; i < 10; i++) await page.keyboard.press("ArrowRight");
  seen.moved = [await covered(page, "own"), await covered(page, "sphere")];
  seen.note = await page.textContent("#place-note");
  return seen;
};
