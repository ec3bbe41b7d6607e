// The page of the three.js tutorial: what it shows once its maps are there, as a PNG in base64.

export default async ({ page, url }) => {
  await page.goto(url + "index.html", { waitUntil: "networkidle" });
  await page.waitForTimeout(2000); // until it is drawn
  return (await page.screenshot()).toString("base64");
};
