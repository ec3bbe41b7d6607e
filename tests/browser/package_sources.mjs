// One photo as everything that can hold a picture. arguments: { page }: with the package's import map; nine spherical
// harmonics of each, and what is refused.

export default async ({ page, url, arguments: given }) => {
  await page.goto(url + given.page);
  await page.waitForFunction(() => document.body.dataset.light, null, { polling: 100 });
  return page.evaluate(async () => {
    const { AnyProbe } = await import("anyprobe");
    const probe = await AnyProbe.load({ threads: 1 });
    const image = new Image();
    image.src = "./vase.png";
    await image.decode();
    const { naturalWidth: width, naturalHeight: height } = image;
    const drawn = (canvas) => {
      canvas.getContext("2d").drawImage(image, 0, 0);
      return canvas;
    };
    const canvas = drawn(Object.assign(document.createElement("canvas"), { width, height }));
    const data = canvas.getContext("2d").getImageData(0, 0, width, height);
    const gl = new OffscreenCanvas(1, 1).getContext("webgl2");
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true); // the lowest row first, as a camera's texture has it
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, data);
    const sources = {
      image,
      canvas,
      offscreen: drawn(new OffscreenCanvas(width, height)),
      bitmap: await createImageBitmap(image),
      data,
      texture: { gl, texture, width, height },
    };
    const mask = Object.assign(document.createElement("canvas"), { width, height });
    mask.getContext("2d").drawImage(image, 0, 0);
    const context = mask.getContext("2d");
    context.globalCompositeOperation = "source-in";
    context.fillStyle = "white";
    context.fillRect(0, 0, width, height);
    const sh9 = {};
    for (const [name, source] of Object.entries(sources)) sh9[name] = [...(await probe.estimate(source, { fovDeg: 24 })).sh9];
    sh9.masked = [...(await probe.estimate(image, { mask, fovDeg: 24 })).sh9];
    const { mask: found, quality } = await probe.mask(image, { box: [145, 95, 367, 417] });
    const refused = {};
    const tell = async (name, ask) => (refused[name] = await ask().then(() => null, (error) => error.message));
    await tell("empty", () => probe.estimate(new Image()));
    await tell("mask", () => probe.estimate(image, { mask: new Float32Array(9) }));
    await tell("normals", () => probe.estimate(image, { normals: new Float32Array(9) }));
    await tell("engine", () => AnyProbe.load({ engine: "webgl" }));
    await tell("webgpu", () => AnyProbe.load({ engine: "webgpu" }));
    const asked = probe.estimate(image);
    probe.dispose();
    await tell("disposed", () => asked);
    const covered = found.reduce((sum, value) => sum + value, 0) / found.length;
    return { sh9, refused, covered, quality, hasWebgpu: Boolean(await navigator.gpu?.requestAdapter()) };
  });
};
