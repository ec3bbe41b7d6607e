// What can be reached without a mouse, and whether a phone shows all of it.

import { focusable, openPage } from "./page_steps.mjs";

/** Of each control the heading it stands under: the lowest one that is above it, in its column. */
const headingOfEach = (page) =>
  page.evaluate(() => {
    const boxOf = (one) => one.getBoundingClientRect();
    const headings = [...document.querySelectorAll("main :is(h2, h3, legend):not(.unseen)")];
    const above = (one) =>
      headings
        .filter((heading) => boxOf(heading).bottom <= boxOf(one).top + 1)
        .filter((heading) => boxOf(heading).left < boxOf(one).right && boxOf(one).left < boxOf(heading.parentElement).right)
        .sort((a, b) => boxOf(a).bottom - boxOf(b).bottom);
    const controls = [...document.querySelectorAll("main :is(button, input, select)")].filter((one) => one.id && one.tabIndex >= 0 && one.checkVisibility());
    return Object.fromEntries(controls.map((one) => [one.id, above(one).at(-1)?.textContent ?? null]));
  });

export default async ({ page, url }) => {
  await openPage(page, url);
  await page.waitForFunction(() => getComputedStyle(document.getElementById("overlay")).visibility === "visible", null, { polling: 100 });
  const named = await focusable(page);
  const reached = [];
  await page.evaluate(() => document.body.focus());
  for (let i = 0; i < named.length; i++) {
    await page.keyboard.press("Tab");
    reached.push(await page.evaluate(() => document.activeElement.id));
  }
  const unnamed = await page.evaluate(() =>
    [...document.querySelectorAll("canvas, video")]
      .filter((one) => !one.getAttribute("aria-label") && !one.closest("[aria-hidden=true]"))
      .map((one) => one.id),
  );
  await page.focus("#overlay");
  const foot = () => page.evaluate(() => document.getElementById("overlay").toDataURL().length);
  const size = await page.inputValue("#size");
  await page.keyboard.press("+");
  const larger = await page.inputValue("#size");
  await page.focus("#mask");
  await page.keyboard.press("ArrowRight");
  const cross = await page.evaluate(() => document.getElementById("cross").style.left);
  const taken = await page.evaluate(() => {
    const isTaken = (id, key, modifier) => {
      const event = new KeyboardEvent("keydown", { key, [modifier]: true, bubbles: true, cancelable: true });
      document.getElementById(id).dispatchEvent(event);
      return event.defaultPrevented;
    };
    const keys = { overlay: ["+", "=", "-", "ArrowLeft"], mask: ["ArrowLeft", "Enter", "Backspace"] };
    const tried = Object.entries(keys).flatMap(([id, keys]) =>
      keys.flatMap((key) => ["ctrlKey", "metaKey", "altKey"].map((modifier) => [id, key, modifier])),
    );
    return tried.filter((one) => isTaken(...one));
  });
  return {
    named,
    under: await headingOfEach(page),
    reached,
    unnamed,
    drawn: await foot(),
    sizes: [size, larger].map(Number),
    cross,
    taken,
    live: await page.getAttribute("#status", "aria-live"),
    headings: await page.evaluate(() => [...document.querySelectorAll("h1, h2, h3")].map((one) => one.tagName)),
    width: await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]),
    below: await page.evaluate(() =>
      ["frame", "status", "map"].filter((id) => document.getElementById(id).getBoundingClientRect().bottom + scrollY > innerHeight),
    ),
    strip: await page.evaluate(() => {
      const { bottom } = document.getElementById("tools").getBoundingClientRect();
      const tops = [...document.querySelectorAll("main > *")].map((one) => one.getBoundingClientRect().top);
      return Math.min(...tops.filter((top) => top >= bottom)) - bottom;
    }),
    small: await page.evaluate(() =>
      [...document.querySelectorAll("button, select")]
        .filter((one) => one.checkVisibility() && one.getBoundingClientRect().height < 40)
        .map((one) => one.id),
    ),
  };
}
