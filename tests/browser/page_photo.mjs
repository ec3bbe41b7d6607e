// A photo of one's own: chosen, marked by clicks, relit, downloaded.
// arguments: { photo, opaque, backdrop, glb, click, targets, folder }; backdrop: a photo of one colour behind the object

import { join } from "node:path";
import { estimated, openPage, waitForStatus } from "./page_steps.mjs";

/** For one step: the slowest, which opens the networks, takes ten seconds. */
const STEP_MS = 60_000;

/** Chromium drops a page's eleventh download within a second without a word: between two, more than a tenth of one. */
const PAUSE_MS = 150;

export default async ({ page, url, arguments: given }) => {
  page.setDefaultTimeout(STEP_MS);
  const elsewhere = await openPage(page, url);
  const seen = { example: await page.textContent("#direction") };
  await page.setInputFiles("#file", given.photo);
  await estimated(page);
  seen.direction = await page.textContent("#direction");

  const files = {};
  const save = async (click, folder = given.folder) => {
    await page.waitForTimeout(PAUSE_MS);
    const [download] = await Promise.all([page.waitForEvent("download"), click()]);
    const path = join(folder, download.suggestedFilename());
    await download.saveAs(path);
    return path;
  };
  const kindOf = (kind) => () => page.click(`#downloads button >> text=.${kind}`);
  for (const kind of ["exr", "hdr", "json", "png"]) files[kind] = await save(kindOf(kind));
  for (const target of given.targets) {
    await page.selectOption("#targets", target);
    files[target] = await save(() => page.click("#export"));
  }

  const ask = async (change) => {
    await page.evaluate(() => (document.getElementById("status").textContent = ""));
    await change();
    return waitForStatus(page, /^Estimated|^Click|^Nothing stands out/);
  };

  // one without an alpha channel: the mask is the network's, or the click's
  await page.evaluate(() => {
    const line = document.getElementById("status");
    globalThis.said = [];
    new MutationObserver(() => said.push(line.textContent)).observe(line, { childList: true });
  });
  await page.setInputFiles("#file", given.opaque);
  await estimated(page);
  seen.said = await page.evaluate(() => said);
  await page.click("#status a");
  seen.focused = await page.evaluate(() => document.activeElement.id);
  const box = await page.locator("#mask").boundingBox();
  const position = { x: given.click[0] * box.width, y: given.click[1] * box.height };
  seen.clicked = await ask(() => page.locator("#mask").click({ position }));

  seen.background = {};
  for (const kind of ["exr", "json"]) seen.background[kind] = await save(kindOf(kind), join(given.folder, "background"));
  seen.alone = await ask(() => page.selectOption("#surroundings", "none"));

  await page.selectOption("#surroundings", "auto");
  seen.backdrop = await ask(() => page.setInputFiles("#file", given.backdrop));

  await page.setInputFiles("#model-file", given.glb);
  await page.waitForFunction(() => document.getElementById("shape").value === "own", null, { polling: 200 });
  seen.material = await page.inputValue("#material");
  await page.setInputFiles("#model-file", { name: "no.glb", mimeType: "model/gltf-binary", buffer: Buffer.from("nothing") });
  await page.waitForFunction(() => document.getElementById("status").textContent.startsWith("no.glb"), null, { polling: 200 });
  return { ...seen, files, elsewhere };
}
