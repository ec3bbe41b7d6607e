// A built page that estimates a photo. arguments: { page }; its light, what was fetched, and what could not be.

export default async ({ page, url, arguments: given }) => {
  const [fetched, failed] = [[], []];
  page.on("response", (answer) => (answer.status() >= 400 ? failed : fetched).push(answer.url()));
  const fault = new Promise((_, reject) => page.on("pageerror", reject));
  await page.goto(url + given.page);
  await Promise.race([page.waitForFunction(() => document.body.dataset.light, null, { polling: 100 }), fault]);
  return { light: JSON.parse(await page.evaluate(() => document.body.dataset.light)), fetched, failed };
};
