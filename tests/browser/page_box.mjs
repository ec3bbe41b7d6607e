// A box around part of a photo's object: by mouse, by key, by finger. arguments: { photo, box, screenshot? }
// Boxes are shares of the picture; `outlines` are those of what was found, likewise; `hints` tells whether dragging is advised
// before and while a box is drawn, and keys on a touch screen.

import { estimated, openPage, outlined, waitForStatus } from "./page_steps.mjs";

const STEP = 0.02; // of an arrow key

export default async ({ page, context, url, arguments: given }) => {
  await openPage(page, url);
  await page.setInputFiles("#file", given.photo);
  await estimated(page);
  const [x0, y0, x1, y1] = given.box;
  const mask = page.locator("#mask");
  await mask.scrollIntoViewIfNeeded();
  const place = await mask.boundingBox();
  const on = (x, y) => [place.x + x * place.width, place.y + y * place.height];
  const forget = () => page.evaluate(() => (document.getElementById("status").textContent = ""));
  const outlines = { before: await outlined(page) };
  const hints = { before: await page.isVisible(".dragging") };
  let band;
  const drawn = async (name, draw) => {
    await page.click("#reset");
    await estimated(page);
    await forget();
    await draw();
    await waitForStatus(page, /^Estimated|^Click|^Nothing stands out/);
    outlines[name] = await outlined(page);
  };

  await drawn("mouse", async () => {
    await page.mouse.move(...on(x1, y0));
    await page.mouse.down();
    await page.mouse.move(...on((x0 + x1) / 2, (y0 + y1) / 2), { steps: 4 });
    band = await page.isVisible("#band");
    await page.mouse.move(...on(x0, y1), { steps: 4 });
    await page.mouse.up();
  });
  if (given.screenshot) await page.screenshot({ path: given.screenshot, fullPage: true });

  const middle = [(x0 + x1) / 2, (y0 + y1) / 2];
  await drawn("click", () => page.mouse.click(...on(...middle)));
  await drawn("wobble", async () => {
    await page.mouse.move(...on(...middle));
    await page.mouse.down();
    await page.mouse.move(on(...middle)[0] + 2, on(...middle)[1] + 2);
    await page.mouse.up();
  });

  await drawn("keys", async () => {
    await page.focus("#draw-box");
    await page.keyboard.press("Enter");
    await press(page, "ArrowLeft", (middle[0] - x0) / STEP); // the cross is where the click was
    await press(page, "ArrowUp", (middle[1] - y0) / STEP);
    await page.keyboard.press("Enter");
    await press(page, "ArrowRight", (x1 - x0) / STEP);
    await press(page, "ArrowDown", (y1 - y0) / STEP);
    await page.keyboard.press("Enter");
  });
  const pressed = [await page.getAttribute("#draw-box", "aria-pressed")];

  await drawn("finger", async () => {
    await page.click("#draw-box");
    pressed.push(await page.getAttribute("#draw-box", "aria-pressed"));
    const client = await context.newCDPSession(page);
    await client.send("Emulation.setTouchEmulationEnabled", { enabled: true });
    [hints.dragging, hints.keys] = [await page.isVisible(".dragging"), await page.isVisible(".keys")];
    const touch = (type, ...points) =>
      client.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y]) => ({ x, y })) });
    await touch("touchStart", on(x0, y0));
    await touch("touchMove", on(...middle));
    await touch("touchMove", on(x1, y1));
    await touch("touchEnd");
  });
  pressed.push(await page.getAttribute("#draw-box", "aria-pressed"));
  return { outlines, band, pressed, hints };
};

async function press(page, key, times) {
  for (let i = 0; i < Math.round(times); i++) await page.keyboard.press(key);
}
