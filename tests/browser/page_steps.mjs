// What several tests of the live page do: open it, wait for its line of status.

/** Open the page and wait until it is finished; says what it asked other machines for. */
export async function openPage(page, url, query = "") {
  const elsewhere = [];
  page.on("request", (request) => {
    const { origin, protocol } = new URL(request.url());
    if (/^https?:$/.test(protocol) && origin !== new URL(url).origin) elsewhere.push(request.url());
  });
  await page.goto(url + query);
  await page.waitForSelector("html[data-ready=true]");
  return elsewhere;
}

export const status = (page) => page.textContent("#status");

/** Wait until the line of status matches; a fault that does not match ends it. */
export async function waitForStatus(page, pattern) {
  const seen = await page.waitForFunction(
    ([source]) => {
      const line = document.getElementById("status");
      if (new RegExp(source).test(line.textContent)) return { text: line.textContent };
      return line.classList.contains("fault") ? { fault: line.textContent } : null;
    },
    [pattern.source],
    { polling: 200 },
  );
  const { text, fault } = await seen.jsonValue();
  if (fault) throw new Error(`the page says: ${fault}`);
  return text;
}

export const estimated = (page) => waitForStatus(page, /^Estimated/);

/** Where the outline lies that is drawn on the picture: x0, y0, x1, y1 as shares. */
export function outlined(page) {
  return page.evaluate(() => {
    const canvas = document.getElementById("mask");
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    const found = [1, 1, 0, 0];
    for (let i = 0; i < data.length; i += 4) {
      if (data[i] !== 255 || data[i + 1] !== 196 || data[i + 2] !== 0) continue;
      const [x, y] = [((i / 4) % width) / width, Math.floor(i / 4 / width) / height];
      [found[0], found[1]] = [Math.min(found[0], x), Math.min(found[1], y)];
      [found[2], found[3]] = [Math.max(found[2], x), Math.max(found[3], y)];
    }
    return found;
  });
}

/** Names and accessible names of everything that can be focused, in the order of Tab. */
export function focusable(page) {
  return page.evaluate(() =>
    [...document.querySelectorAll("button, input, select, a[href], [tabindex]")]
      .filter((one) => one.tabIndex >= 0 && !one.disabled && one.checkVisibility())
      .map((one) => ({
        id: one.id,
        name: (one.getAttribute("aria-label") ?? one.labels?.[0]?.textContent ?? one.querySelector("img")?.alt ?? one.textContent).trim(),
      })),
  );
}
