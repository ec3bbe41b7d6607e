// What a mark or a file that gives nothing leaves on show. arguments: { photo, on, beside, files }: an opaque photo, x and y as
// shares of it on its object and where nothing is, and files that are no photos
// → { first, click, box, again, marked, pending, reset, small, refused, png }: the page after each, with what was marked for it;
//   small: after an object of too few pixels

import { openPage, status, waitForStatus } from "./page_steps.mjs";

export default async ({ page, url, arguments: given }) => {
  page.setDefaultTimeout(60_000);
  await page.addInitScript(() => {
    globalThis.asked = { hints: null, held: null, lights: 0 };
    const post = Worker.prototype.postMessage;
    const firstOf = (mask, count) => mask.map((value) => (value > 0.5 && count-- > 0 ? 1 : 0));
    Worker.prototype.postMessage = function (message, transfer) {
      if (message.say === "mark") asked.hints = message.hints;
      if (message.say === "estimate" && asked.tooSmall) message = { ...message, mask: firstOf(message.mask, 9) };
      if (message.say === "estimate" && asked.held) asked.held.push(() => post.call(this, message, transfer));
      else post.call(this, message, transfer);
    };
    document.addEventListener("anyprobe-light", () => asked.lights++);
  });
  await openPage(page, url);
  const look = () =>
    page.evaluate(() => {
      const [status, direction, quality, mask] = ["status", "direction", "mask-quality", "mask"].map((id) => document.getElementById(id));
      const buttons = document.querySelectorAll("#downloads button:enabled").length;
      return {
        status: status.textContent,
        kind: status.className,
        link: status.querySelector("a")?.hash ?? null,
        kept: { direction: direction.textContent, quality: quality.hidden ? null : quality.textContent, mask: mask.toDataURL(), buttons },
        hints: asked.hints,
        lights: asked.lights,
      };
    });
  const forget = () => page.evaluate(() => (document.getElementById("status").textContent = ""));
  const answered = async (change, pattern) => {
    await forget();
    await change();
    await waitForStatus(page, pattern);
    return look();
  };
  const place = async ([x, y]) => {
    const { width, height } = await page.locator("#mask").boundingBox();
    return { x: x * width, y: y * height };
  };
  const click = async (at) => page.locator("#mask").click({ position: await place(at) });
  const drag = async ([x, y]) => {
    await page.locator("#mask").scrollIntoViewIfNeeded();
    const box = await page.locator("#mask").boundingBox();
    const [left, top] = [box.x + x * box.width, box.y + y * box.height];
    await page.mouse.move(left, top);
    await page.mouse.down();
    await page.mouse.move(left + 20, top + 20, { steps: 4 });
    await page.mouse.up();
  };
  const nothing = /^Nothing stands out there\./;

  const seen = { first: await answered(() => page.setInputFiles("#file", given.photo), /^Estimated/) };
  seen.click = await answered(() => click(given.beside), nothing);
  seen.box = await answered(() => drag(given.beside), nothing);
  seen.again = await answered(() => click(given.on), /^Estimated/);

  // the light of a click is on its way when a box finds nothing
  await page.evaluate(() => (asked.held = []));
  await click(given.on);
  await page.waitForFunction(() => asked.held.length === 1, null, { polling: 50 });
  seen.marked = await look();
  await drag(given.beside);
  await page.waitForFunction(() => asked.held.length === 2, null, { polling: 50 });
  seen.pending = await answered(
    () =>
      page.evaluate(() => {
        const { held } = asked;
        asked.held = null;
        for (const post of held) post();
      }),
    nothing,
  );
  seen.reset = await answered(() => page.click("#reset"), /^Estimated/);

  await page.evaluate(() => (asked.tooSmall = true));
  seen.small = await answered(() => click(given.on), /pixels across/);

  seen.refused = [];
  for (const file of given.files) {
    await forget();
    await page.setInputFiles("#file", file);
    await page.waitForSelector("#status.fault");
    seen.refused.push(await status(page));
    await page.evaluate(() => (document.getElementById("status").className = ""));
  }
  seen.png = await page.getAttribute("#downloads button >> text=.png", "title");
  return seen;
};
