// A page of the example of WebXR in a session of the emulator IWER, which has no camera-access: its views get a camera, and
// getCameraImage a texture of vase.png, the lowest row first. arguments: { page, estimates }: estimates, whether the session
// has a light estimate of its own in the place of the camera. What was asked for, what enters and leaves the scene in which
// order, two states of its light, where a select puts the spheres, the view's pose, and the canvas lit and by default.

export default async ({ page, url, arguments: given }) => {
  const emulator = await (await fetch(`${url}iwer/iwer.js`)).text();
  await page.addInitScript(`${emulator};(${standIn})(${given.estimates}, globalThis.IWER ?? IWER);`);
  await page.goto(url + given.page);
  await page.click("#ARButton:has-text('START AR')");
  await page.waitForFunction(() => stage.light, null, { polling: 100 });
  const lit = await page.evaluate(() => stage.state());
  await page.evaluate(() => (stage.gain = 0.6));
  const hasChanged = (before) => stage.light.lightProbe.sh.toArray().some((value, i) => Math.abs(value - before[i]) > 1e-3);
  await page.waitForFunction(hasChanged, lit.sh, { polling: 100 });
  return page.evaluate(async (lit) => {
    const { renderer, scene, events } = stage;
    const later = await stage.state();
    const controller = renderer.xr.getController(0);
    controller.matrixWorld.makeTranslation(1, 0, 0);
    controller.dispatchEvent({ type: "select" });
    const moved = scene.children.find(({ type, children }) => type === "Group" && children.length === 9).position.toArray();
    controller.matrixWorld.identity(); // back, so that the two canvases show the same
    controller.dispatchEvent({ type: "select" });
    await stage.session.end();
    const { mode, features, hasAskedForACamera, worldFromCamera, fovDeg } = stage;
    return { mode, features, hasAskedForACamera, worldFromCamera, fovDeg, events, lit, later, moved, ended: await stage.state() };
  }, lit);
};

/** Runs before the page: its renderer and scene are heard of as three.js's developer tools hear of them. */
function standIn(estimates, { XRDevice, XRSession, XRView, XRFrame, metaQuest3 }) {
  globalThis.stage = { events: [], light: null, gain: 1, hasAskedForACamera: false };
  const note = (what, object) => {
    if (!object.lightProbe && !object.isLight) return;
    stage.events.push(`${what} ${object.lightProbe ? "estimate" : object.type}`);
    if (what === "add" && object.lightProbe) stage.light = object;
  };
  globalThis.__THREE_DEVTOOLS__ = new EventTarget();
  __THREE_DEVTOOLS__.addEventListener("observe", ({ detail }) => {
    if (detail.isScene && !stage.scene) {
      stage.scene = detail;
      detail.addEventListener("childadded", ({ child }) => note("add", child));
      detail.addEventListener("childremoved", ({ child }) => note("remove", child));
    } else if (detail.isWebGLRenderer) {
      stage.renderer = detail;
      const { render } = detail;
      detail.render = (scene, camera) => {
        if (scene === stage.scene) stage.camera = camera;
        if (scene !== stage.scene || stage.isDrawing) render.call(detail, scene, camera); // in software every frame takes long
      };
    }
  });
  if (navigator.mediaDevices) navigator.mediaDevices.getUserMedia = async () => ((stage.hasAskedForACamera = true), new MediaStream());

  const known = metaQuest3.supportedFeatures.filter((name) => name !== "depth-sensing"); // of which the stand-in binding has none
  const supportedFeatures = [...known, "camera-access", "light-estimation"];
  const device = new XRDevice({ ...metaQuest3, supportedFeatures }, { stereoEnabled: false });
  device.installRuntime({ forceInstall: true });
  device.quaternion.set(0, Math.sin(0.3), 0, Math.cos(0.3)); // looks 34 degrees to the left
  Object.defineProperty(navigator.xr, "offerSession", { value: undefined }); // the button's click asks for it
  const { requestSession } = navigator.xr;
  navigator.xr.requestSession = async function (mode, asked) {
    stage.session = await requestSession.call(navigator.xr, mode, asked);
    stage.mode = mode;
    stage.features = [...(asked.requiredFeatures ?? []), ...(asked.optionalFeatures ?? [])];
    if (estimates) stage.session.requestLightProbe = async () => new EventTarget();
    return stage.session;
  };
  const picture = Object.assign(new Image(), { src: "/vase.png" });
  const camera = { width: 512, height: 512 };
  if (!estimates) {
    Object.defineProperty(XRView.prototype, "camera", {
      get() {
        stage.worldFromCamera = [...this.transform.matrix];
        return stage.features.includes("camera-access") ? camera : undefined;
      },
    });
    const { get } = Object.getOwnPropertyDescriptor(XRView.prototype, "projectionMatrix");
    Object.defineProperty(XRView.prototype, "projectionMatrix", {
      get() {
        const matrix = Float32Array.from(get.call(this)); // of the camera's square picture, as those of phones are
        matrix[0] = matrix[5];
        matrix[8] = matrix[9] = 0;
        stage.fovDeg = (2 * Math.atan(1 / matrix[5]) * 180) / Math.PI;
        return matrix;
      },
    });
  }
  globalThis.XRWebGLBinding = class {
    constructor(session, gl) {
      this.gl = gl;
      this.texture = gl.createTexture();
    }
    getCameraImage() {
      const { gl } = this;
      if (this.gain === stage.gain || !picture.complete) return this.texture;
      this.gain = stage.gain;
      const bound = gl.getParameter(gl.TEXTURE_BINDING_2D);
      const drawn = new OffscreenCanvas(512, 512).getContext("2d");
      drawn.filter = `brightness(${stage.gain})`;
      drawn.fillStyle = "#888";
      drawn.fillRect(0, 0, 512, 512);
      drawn.drawImage(picture, 0, 0);
      gl.bindTexture(gl.TEXTURE_2D, this.texture);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, drawn.canvas);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      gl.bindTexture(gl.TEXTURE_2D, bound);
      return this.texture;
    }
    getReflectionCubeMap() {
      return null;
    }
  };
  XRFrame.prototype.getLightEstimate = () => ({
    sphericalHarmonicsCoefficients: Float32Array.from({ length: 27 }, (_, i) => 1 / (1 + i) + 1e-5 * performance.now()),
    primaryLightIntensity: { x: 3, y: 2, z: 1 },
    primaryLightDirection: { x: 0.6, y: 0.8, z: 0 },
  });
  /** Drawn now, by the scene's own camera. */
  stage.state = async () => {
    for (let i = 0; i < 2; i++) await new Promise((resolve) => setTimeout(resolve, 50));
    const { renderer } = stage;
    const isPresenting = renderer.xr.enabled;
    renderer.xr.enabled = false;
    renderer.setRenderTarget(null);
    stage.isDrawing = true;
    renderer.render(stage.scene, stage.camera);
    stage.isDrawing = false;
    const canvas = renderer.domElement;
    const { width, height } = canvas;
    const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    renderer.xr.enabled = isPresenting;
    const bytes = copy.getImageData(0, 0, width, height).data;
    let text = "";
    for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
    const { lightProbe, directionalLight, environment } = stage.light;
    return {
      sh: lightProbe.sh.toArray(),
      intensity: directionalLight.intensity,
      color: directionalLight.color.toArray(),
      position: directionalLight.position.toArray(),
      reflects: Boolean(environment) && stage.scene.environment === environment,
      drawn: { width, height, rgba: btoa(text) },
    };
  };
}
