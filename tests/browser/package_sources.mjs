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
      url: "./vase.png",
      blob: await (await fetch("./vase.png")).blob(),
      file: new File([await (await fetch("./vase.png")).blob()], "vase.png"),
      unloaded: Object.assign(new Image(), { src: "./vase.png?again" }),
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
    const { data: found, quality } = await probe.mask(image, { box: [145, 95, 367, 417] });
    const { mask: kept } = await probe.estimate(image, { mask, longFovDeg: 24 });
    const refused = {};
    const tell = async (name, ask) => {
      const error = await (async () => ask())().then(() => ({}), (error) => error);
      refused[name] = { name: error.name, code: error.code, message: error.message };
    };
    const asMask = (w, h, value = 0) => ({ mask: { data: new Float32Array(w * h).fill(value) } });
    await tell("nothing", () => probe.estimate(null));
    await tell("empty", () => probe.estimate(new Image()));
    await tell("absent", () => probe.estimate("./absent.png"));
    await tell("text", () => probe.estimate(new Blob(["abc"], { type: "text/plain" })));
    await tell("pixels", () => probe.estimate({ width: 2, height: 2, rgba: new Uint8ClampedArray(3) }));
    await tell("mask", () => probe.estimate(image, asMask(3, 3)));
    await tell("mask of bytes", () => probe.estimate(image, asMask(width, height, 255)));
    await tell("mask of another aspect", () => probe.estimate(image, { mask: new OffscreenCanvas(10, 20) }));
    await tell("no object", () => probe.estimate(image, asMask(width, height)));
    await tell("normals", () => probe.estimate(image, { normals: new Float32Array(9) }));
    await tell("click", () => probe.estimate(data, { click: [600, 3] }));
    await tell("point", () => probe.estimate(data, { click: [{ x: 1, y: 2 }] }));
    await tell("fov", () => probe.estimate(image, { fovDeg: 190 }));
    await tell("unknown", () => probe.estimate(image, { fov: 30 }));
    await tell("material", () => probe.estimate(image, { material: "unobtainium" }));
    await tell("weights", () => AnyProbe.load({ weights: { light: "./absent.onnx" } }));
    await tell("runtime", () => AnyProbe.load({ runtime: "./absent/" }));
    await tell("aborted early", () => probe.estimate(image, { signal: AbortSignal.abort() }));
    const ending = new AbortController();
    const given = probe.estimate(image, { signal: ending.signal });
    ending.abort();
    await tell("aborted", () => given);
    const asked = probe.estimate(image);
    await new Promise((resolve) => setTimeout(resolve, 0)); // an estimate takes 40 ms
    probe.dispose();
    await tell("disposed", () => asked);
    await tell("after", () => probe.estimate(image));
    await tell("track after", () => probe.track(document.createElement("video"), () => {}));
    const size = { width: kept.width, height: kept.height, length: kept.data.length };
    const covered = found.reduce((sum, value) => sum + value, 0) / found.length;
    return { sh9, refused, covered, mask: size, quality };
  });
};
