// A page whose weights are not those of the package. arguments: { page }; the error that ends it.

export default async ({ page, url, arguments: given }) => {
  const failed = page.waitForEvent("pageerror");
  await page.goto(url + given.page);
  return String(await failed);
};
