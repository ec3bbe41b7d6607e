// A mirror ball through the npm package. arguments: { page, fovDeg }: with the package's import map, beside ball.png and
// ball_mask.png; the notices of its light, without and with a material, and its nine spherical harmonics.

export default async ({ page, url, arguments: given }) => {
  await page.goto(url + given.page);
  await page.waitForFunction(() => document.body.dataset.light, null, { polling: 100 });
  return page.evaluate(async (fovDeg) => {
    const { AnyProbe } = await import("anyprobe");
    const probe = await AnyProbe.load({ threads: 1 });
    const about = { mask: "./ball_mask.png", fovDeg };
    const lights = [await probe.estimate("./ball.png", about), await probe.estimate("./ball.png", { ...about, material: "matte" })];
    probe.dispose();
    return lights.map(({ notices, sh9 }) => ({ codes: notices.map(({ code }) => code), sh9: [...sh9] }));
  }, given.fovDeg);
};
