// The light of one picture, followed from everything that gives frames. arguments: { page }: with the package's import map;
// of each source the last of three lights, and the events of a ProbeLight in two XR sessions, one after the other.

export default async ({ page, url, arguments: given }) => {
  await page.goto(url + given.page);
  await page.waitForFunction(() => document.body.dataset.light, null, { polling: 100 });
  return page.evaluate(async () => {
    const [{ AnyProbe }, { ProbeLight }, { WebGLRenderer }] = await Promise.all(
      ["anyprobe", "anyprobe/three", "three"].map((name) => import(name)),
    );
    const probe = await AnyProbe.load({ threads: 1 });
    const image = Object.assign(new Image(), { src: "./vase.png" });
    await image.decode();
    const { naturalWidth: width, naturalHeight: height } = image;
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const context = canvas.getContext("2d");
    const draw = () => {
      context.fillStyle = "#888";
      context.fillRect(0, 0, width, height);
      context.drawImage(image, 0, 0);
    };
    draw();
    setInterval(draw, 50); // a canvas that nobody draws gives its stream no frames
    const hints = { click: [width / 2, 0.55 * height], fovDeg: 24 };

    /** The third light of a source; feed: offers a frame again and again. */
    const third = (source, options = {}, feed = null) =>
      new Promise((resolve, reject) => {
        let [count, timer] = [0, null];
        const onLight = (light) => {
          if (++count < 3) return;
          clearInterval(timer);
          tracker.stop();
          resolve({ direction: light.dominant.direction, isInWorld: light.isInWorld, size: [light.mask.width, light.mask.height] });
        };
        const tracker = probe.track(source, onLight, { ...hints, ...options, onError: reject });
        if (feed) timer = setInterval(() => feed(tracker), 50);
      });

    const gl = new OffscreenCanvas(1, 1).getContext("webgl2");
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true); // the lowest row first, as a camera's texture has it
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
    const aside = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]; // column by column: a quarter to the left
    const lights = {
      canvas: await third(canvas),
      posed: await third(canvas, { pose: () => aside }),
      track: await third(canvas.captureStream(30).getVideoTracks()[0]),
      bitmap: await third(null, {}, async (tracker) => tracker.offer(await createImageBitmap(canvas))),
      texture: await third(null, {}, (tracker) => tracker.offer({ gl, texture, width, height }, { pose: aside })),
    };

    const { xr } = new WebGLRenderer();
    const light = new ProbeLight(probe, false);
    const events = [];
    xr.addEventListener("sessionstart", () => light.track(canvas, hints));
    xr.addEventListener("sessionend", () => light.stop());
    for (const type of ["estimationstart", "estimationend"]) light.addEventListener(type, () => events.push(type));
    for (let session = 0; session < 2; session++) {
      xr.dispatchEvent({ type: "sessionstart" });
      while (events.at(-1) !== "estimationstart") await new Promise((resolve) => setTimeout(resolve, 20));
      xr.dispatchEvent({ type: "sessionend" });
    }
    probe.dispose();
    return { lights, events };
  });
};
