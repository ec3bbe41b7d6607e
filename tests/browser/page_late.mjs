// What the networks answer late, after another picture was put on show. arguments: { photo, other, plain }: opaque photos of
// different sizes, nothing in the last. Masks are held back on their way to the networks until they are let go.

import { estimated, openPage, status, waitForStatus } from "./page_steps.mjs";

export default async ({ page, url, arguments: given }) => {
  await page.addInitScript(() => {
    globalThis.networks = { sent: [], held: null, answers: 0, heard: new Set() };
    const post = Worker.prototype.postMessage;
    Worker.prototype.postMessage = function (message, transfer) {
      if (!networks.heard.has(this)) this.addEventListener("message", ({ data }) => (networks.answers += data.id !== undefined));
      networks.heard.add(this);
      const { say, picture, options } = message;
      networks.sent.push({ say, width: picture?.width, surroundings: options?.surroundings });
      if (say === "mark" && networks.held) networks.held.push(() => post.call(this, message, transfer));
      else post.call(this, message, transfer);
    };
  });
  await openPage(page, url);
  const direction = () => page.textContent("#direction");
  const estimates = () => page.evaluate(() => networks.sent.filter(({ say }) => say === "estimate"));
  const hold = () => page.evaluate(() => (networks.held = []));
  const held = () => page.waitForFunction(() => networks.held.length === 1, null, { polling: 50 });
  const settled = () => page.waitForTimeout(500);
  /** Let the mask go, and wait for it and what it brings. */
  const letGo = () =>
    page.evaluate(async () => {
      const { answers, held } = networks;
      networks.held = null;
      for (const post of held) post();
      while (networks.answers === answers) await new Promise((resolve) => setTimeout(resolve, 20));
    });
  const openAnother = async (photo) => {
    await page.evaluate(() => (document.getElementById("status").textContent = ""));
    await page.setInputFiles("#file", photo);
  };
  const shown = async () => ({
    status: await status(page),
    direction: await direction(),
    mask: await page.evaluate(() => document.getElementById("mask").toDataURL()),
  });
  const seen = { late: {} };

  for (const [name, ask] of [["click", "#mask"], ["reset", "#reset"]]) {
    await openAnother(given.photo);
    await estimated(page);
    await hold();
    await page.click(ask);
    await held();
    await page.click("#example");
    await waitForStatus(page, /^This is an example/);
    const [before, count] = [await shown(), (await estimates()).length];
    await letGo();
    await settled();
    const after = await shown();
    const same = Object.fromEntries(Object.keys(before).map((part) => [part, before[part] === after[part]]));
    seen.late[name] = { ...same, estimates: (await estimates()).length - count };
  }

  await openAnother(given.photo);
  await estimated(page);
  let count = (await estimates()).length;
  await hold();
  await openAnother(given.other);
  await held();
  const usable = () => page.evaluate(() => document.querySelectorAll("#downloads button:enabled, #export:enabled").length);
  seen.waiting = { direction: await direction(), usable: await usable() };
  await page.selectOption("#surroundings", "none");
  await settled();
  seen.waiting.estimates = (await estimates()).length - count;
  await letGo();
  await estimated(page);
  seen.then = { usable: await usable(), estimates: (await estimates()).slice(count) };

  await page.selectOption("#surroundings", "auto");
  await openAnother(given.plain);
  await waitForStatus(page, /^Nothing stands out there\. Click/);
  count = (await estimates()).length;
  await page.selectOption("#surroundings", "none");
  await settled();
  seen.nothing = { status: await status(page), usable: await usable(), estimates: (await estimates()).length - count };
  return seen;
};
