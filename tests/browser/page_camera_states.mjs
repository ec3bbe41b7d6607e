// The camera in every state: being opened, live, turned, its object lost, ended. arguments: { photo, broken }
// The camera is a canvas that shows the photo; it is given when `camera.allow` is called.

import { readFileSync } from "node:fs";
import { estimated, openPage, outlined, status, waitForStatus } from "./page_steps.mjs";

export default async ({ page, context, url, arguments: given }) => {
  await page.addInitScript((source) => {
    globalThis.camera = { size: [640, 480], isEmpty: false, asked: [], tracks: [], lights: 0, unheard: [] };
    const picture = new Image();
    const ready = new Promise((resolve) => (picture.onload = resolve));
    camera.allow = () => camera.asked.splice(0).forEach((give) => give());
    navigator.mediaDevices.getUserMedia = async () => {
      picture.src ||= source;
      await Promise.all([ready, new Promise((resolve) => camera.asked.push(resolve))]);
      const context = document.createElement("canvas").getContext("2d");
      const draw = () => {
        const [width, height] = camera.size;
        if (context.canvas.width !== width) Object.assign(context.canvas, { width, height });
        const side = Math.min(width, height);
        context.fillStyle = "#807f7e";
        context.fillRect(0, 0, width, height);
        if (!camera.isEmpty) context.drawImage(picture, (width - side) / 2, (height - side) / 2, side, side);
        context.fillStyle = `rgb(${255 * Math.random()}, 0, 0)`; // another picture each time
        context.fillRect(0, 0, 2, 2);
      };
      draw();
      setInterval(draw, 100);
      const stream = context.canvas.captureStream(10);
      camera.tracks.push(stream.getVideoTracks()[0]);
      return stream;
    };
    document.addEventListener("anyprobe-light", () => camera.lights++);
    addEventListener("unhandledrejection", ({ reason }) => camera.unheard.push(String(reason)));
  }, `data:image/jpeg;base64,${readFileSync(given.photo).toString("base64")}`);
  await openPage(page, url);
  const state = () =>
    page.evaluate(() => {
      const [video, photo, frame, mask] = ["video", "photo", "frame", "mask"].map((id) => document.getElementById(id));
      return {
        status: document.getElementById("status").textContent,
        button: document.getElementById("camera").textContent,
        tracks: camera.tracks.map(({ readyState }) => readyState),
        shown: [video, photo].filter((one) => !one.hidden).map(({ id }) => id),
        aspect: frame.style.aspectRatio,
        mask: mask.width / mask.height,
      };
    });
  const press = () => page.evaluate(() => document.getElementById("camera").click());
  const asked = () => page.waitForFunction(() => camera.asked.length > 0, null, { polling: 50 });
  const lit = (more) =>
    page.evaluate(async (more) => {
      const enough = camera.lights + more;
      while (camera.lights < enough) await new Promise((resolve) => setTimeout(resolve, 50));
    }, more);
  const seen = {};

  // two presses, a click and another wish before the networks are open
  let fetchNetworks;
  const wanted = new Promise((resolve) => (fetchNetworks = resolve));
  await context.route("**/weights/**", (route) => wanted.then(() => route.continue()));
  await press();
  await press();
  await asked();
  await page.evaluate(() => camera.allow());
  await page.waitForSelector("#camera.running");
  await page.locator("#mask").click();
  await page.selectOption("#surroundings", "none");
  await page.waitForTimeout(200);
  fetchNetworks();
  await waitForStatus(page, /^Live, in this browser/);
  await lit(3);
  seen.live = await state();
  seen.outline = await outlined(page);

  await page.setInputFiles("#file", given.broken);
  await page.waitForSelector("#status.fault");
  await lit(3);
  seen.broken = await state();
  await page.evaluate(() => (document.getElementById("status").className = "")); // a fault would end the waiting below

  await page.evaluate(() => (camera.size = [480, 640]));
  await page.waitForFunction(() => document.getElementById("frame").style.aspectRatio === "480 / 640", null, { polling: 50 });
  await lit(10); // the mask's picture too is one of these
  seen.turned = await state();
  seen.turnedOutline = await outlined(page);
  seen.overlay = await page.evaluate(() => document.getElementById("overlay").style.visibility);

  await page.evaluate(() => (camera.isEmpty = true));
  await waitForStatus(page, /^No object is seen/);
  seen.lines = await page.evaluate(async () => {
    let lines = 0;
    const watcher = new MutationObserver((list) => (lines += list.length));
    watcher.observe(document.getElementById("status"), { childList: true });
    await new Promise((resolve) => setTimeout(resolve, 1500));
    watcher.disconnect();
    return lines;
  });
  await page.evaluate(() => (camera.isEmpty = false));
  seen.found = await waitForStatus(page, /^Live, in this browser/);

  await page.evaluate(() => {
    camera.tracks[0].stop();
    camera.tracks[0].dispatchEvent(new Event("ended")); // which a browser does for a camera that is unplugged
  });
  await page.waitForSelector("#status.fault");
  seen.ended = await state();
  seen.usable = await page.evaluate(() => document.querySelectorAll("#downloads button:enabled").length);

  // a photo chosen while the camera is asked for
  await press();
  await asked();
  await page.setInputFiles("#file", given.photo);
  await estimated(page);
  await page.evaluate(() => camera.allow());
  await page.waitForFunction(() => camera.tracks.length === 2, null, { polling: 50 });
  await page.waitForTimeout(500);
  seen.photo = await state();

  // an answer that comes while the camera is asked for leaves what is said of that
  await page.setInputFiles("#file", given.photo);
  await waitForStatus(page, /^Finding the object/);
  await press();
  await asked();
  await lit(1);
  seen.opening = await state();

  // the button again: the camera is closed at once
  await page.evaluate(() => camera.allow());
  await page.waitForSelector("#camera.running");
  await press();
  seen.closed = await state();
  await waitForStatus(page, /^The camera is off; this is the photo before it/);
  seen.unheard = await page.evaluate(() => camera.unheard);
  return seen;
};
