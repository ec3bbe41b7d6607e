// A page that uses the npm package. arguments: { page, screenshot? }; the direction of its dominant light, its canvas'
// pixels (RGBA, base64), what could not be fetched, and how long it took.

export default async ({ page, url, arguments: given }) => {
  const failed = [];
  page.on("response", (answer) => answer.status() >= 400 && failed.push(answer.url()));
  const start = Date.now();
  await page.goto(url + given.page);
  await page.waitForFunction(() => document.body.dataset.light, null, { polling: 100 });
  const seconds = (Date.now() - start) / 1000;
  await page.waitForTimeout(300); // until it is drawn where a framework draws it
  if (given.screenshot) await page.screenshot({ path: given.screenshot });
  const drawn = await page.evaluate(() => {
    const canvas = document.querySelector("canvas");
    const { width, height } = canvas;
    const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const bytes = copy.getImageData(0, 0, width, height).data;
    let text = "";
    for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
    return { width, height, rgba: btoa(text) };
  });
  return { seconds, failed, direction: JSON.parse(await page.evaluate(() => document.body.dataset.light)), drawn };
};
