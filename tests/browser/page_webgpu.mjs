// One photo on two engines. arguments: { photo }; of each { seconds, radiance (base64), direction }; adapter: null
// where the browser has none, else what it calls itself.

import { openPage, waitForStatus } from "./page_steps.mjs";

export default async ({ page, url, arguments: given }) => {
  await page.addInitScript(() => {
    document.addEventListener("anyprobe-light", ({ detail }) => (globalThis.lastLight = detail.light));
  });
  await openPage(page, url);
  const adapter = await page.evaluate(async () => {
    const found = await navigator.gpu?.requestAdapter();
    return found ? `${found.info.vendor} ${found.info.architecture}` : null;
  });
  const seen = { adapter };
  if (!adapter) return seen;
  for (const engine of ["wasm", "webgpu"]) {
    await openPage(page, url, `?engine=${engine}`);
    await page.setInputFiles("#file", given.photo);
    const said = await waitForStatus(page, /^Estimated/);
    seen[engine] = await page.evaluate(() => {
      const bytes = new Uint8Array(lastLight.radiance.slice().buffer);
      let text = "";
      for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
      return { radiance: btoa(text), direction: lastLight.dominant.direction };
    });
    seen[engine].seconds = Number(said.match(/light in ([\d.]+) s/)?.[1]);
  }
  return seen;
};
