// The handle on the picture, and what a press beside it takes. → { differing, dragged, middle, moved, asked, box }: whether the
// left and the right of the virtual object differ from the photo while the handle stands at 0, at 100, and where it was dragged
// to (its value, and that of the object's middle); how far the object was moved, in shares of the picture; masks asked for
// meanwhile, and by a drag across it where the handle hides it, with its box

import { openPage, waitForStatus } from "./page_steps.mjs";

export default async ({ page, url }) => {
  await page.addInitScript(() => {
    globalThis.asked = [];
    const post = Worker.prototype.postMessage;
    Worker.prototype.postMessage = function (message, transfer) {
      if (message.say === "mark") asked.push(message.hints);
      post.call(this, message, transfer);
    };
  });
  await openPage(page, url);
  await page.waitForFunction(() => getComputedStyle(document.getElementById("overlay")).visibility === "visible", null, { polling: 100 });
  await page.uncheck("#outline");
  const frame = await page.locator("#frame").boundingBox();
  const at = ([x, y]) => [frame.x + x * frame.width, frame.y + y * frame.height];
  const seen = { differing: {} };

  // the sphere without its shadow, as shares of the picture
  const [x0, y0, x1, y1] = await opaque(page);
  const middle = [(x0 + x1) / 2, (y0 + y1) / 2];
  const places = [0.3, 0.7].map((share) => [x0 + share * (x1 - x0), middle[1]]);
  const look = async (name) => (seen.differing[name] = await pixels(page, places.map(at)));
  await page.locator("#overlay").evaluate((overlay) => (overlay.style.opacity = 0));
  const photo = await pixels(page, places.map(at));
  await page.locator("#overlay").evaluate((overlay) => (overlay.style.opacity = 1));
  for (const value of ["0", "100"]) {
    await page.locator("#before").fill(value);
    await look(value);
  }

  // by the mouse, from where it stands at the right border
  const knob = [frame.x + frame.width - 16, frame.y + frame.height - 24];
  await page.mouse.move(...knob);
  await page.mouse.down();
  await page.mouse.move(at(middle)[0], knob[1], { steps: 5 });
  await page.mouse.up();
  await look("dragged");
  seen.dragged = Number(await page.inputValue("#before"));
  seen.middle = 100 * middle[0];
  for (const name of Object.keys(seen.differing)) {
    seen.differing[name] = seen.differing[name].map((pixel, i) => Math.max(...pixel.map((value, c) => Math.abs(value - photo[i][c]))) > 12);
  }

  const drag = async (from, to) => {
    await page.mouse.move(...at(from));
    await page.mouse.down();
    await page.mouse.move(...at(to), { steps: 5 });
    await page.mouse.up();
  };
  await page.locator("#before").fill("0");
  const drawn = page.evaluate(() => new Promise((done) => document.getElementById("overlay").addEventListener("drawn", done, { once: true })));
  await drag(middle, [middle[0] - 0.1, middle[1]]);
  await drawn; // the first, perhaps before the last move
  await page.evaluate(() => document.getElementById("turn").dispatchEvent(new Event("input")));
  await page.evaluate(() => new Promise((done) => document.getElementById("overlay").addEventListener("drawn", done, { once: true })));
  seen.moved = x0 - (await opaque(page))[0];
  seen.asked = { moving: await page.evaluate(() => asked.length) };
  await page.locator("#before").fill("100");
  await page.evaluate(() => (document.getElementById("status").textContent = ""));
  await drag([x0 - 0.1, y0], [x1 - 0.1, y1]);
  await waitForStatus(page, /^Estimated|^Nothing stands out/);
  Object.assign(seen.asked, { wiped: await page.evaluate(() => asked.length) });
  seen.box = await page.evaluate(() => asked[0].box);
  return seen;
};

/** RGB of the page at places of the window. */
async function pixels(page, places) {
  const shot = (await page.screenshot()).toString("base64");
  return page.evaluate(
    async ([shot, places]) => {
      const image = new Image();
      image.src = `data:image/png;base64,${shot}`;
      await image.decode();
      const context = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height }).getContext("2d");
      context.drawImage(image, 0, 0);
      return places.map(([x, y]) => [...context.getImageData(Math.round(x), Math.round(y), 1, 1).data.slice(0, 3)]);
    },
    [shot, places],
  );
}

/** Bounds of what of the overlay is opaque, as shares. */
function opaque(page) {
  return page.evaluate(() => {
    const overlay = document.getElementById("overlay");
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
  });
}
