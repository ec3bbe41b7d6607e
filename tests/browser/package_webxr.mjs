// A page of the example webxr.js in a stand-in for a session. arguments: { page, estimates }: estimates, whether the
// session has a light estimate of its own. What the page asks of the session, what enters and leaves the scene in which
// order, two states of its light, where a controller's select puts the spheres, and the canvas lit and by default.

export default async ({ page, context, url, arguments: given }) => {
  await context.grantPermissions(["camera"], { origin: new URL(url).origin });
  await page.addInitScript(standIn, given.estimates);
  await page.goto(url + given.page);
  await page.click("#ARButton:has-text('START AR')");
  await page.evaluate(() => stage.renderer.xr.dispatchEvent({ type: "sessionstart" }));
  await page.waitForFunction(() => stage.light, null, { polling: 100 });
  const lit = await page.evaluate(() => stage.state());
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
    renderer.xr.dispatchEvent({ type: "sessionend" });
    return { asked: stage.asked, events, lit, later, moved, ended: await stage.state() };
  }, lit);
};

/** Runs before the page: its renderer and scene are heard of as three.js's developer tools hear of them. */
function standIn(estimates) {
  globalThis.stage = { asked: null, events: [], light: null };
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
      detail.xr.getSession = () => session;
      const { render } = detail;
      detail.render = (scene, camera) => {
        stage.camera = camera;
        render.call(detail, scene, camera);
      };
    }
  });
  Object.defineProperty(navigator, "xr", {
    value: {
      isSessionSupported: async () => true,
      requestSession: (mode, { optionalFeatures }) => {
        stage.asked = [mode, optionalFeatures];
        return new Promise(() => {}); // the button's own session is not opened
      },
    },
  });
  const session = { requestAnimationFrame: (call) => requestAnimationFrame((time) => call(time, frame)) };
  if (estimates) session.requestLightProbe = async () => new EventTarget();
  const frame = {
    session,
    getLightEstimate: () => ({
      sphericalHarmonicsCoefficients: Float32Array.from({ length: 27 }, (_, i) => 1 / (1 + i) + 1e-5 * performance.now()),
      primaryLightIntensity: { x: 3, y: 2, z: 1 },
      primaryLightDirection: { x: 0.6, y: 0.8, z: 0 },
    }),
  };
  globalThis.XRWebGLBinding = class {
    getReflectionCubeMap() {
      return null;
    }
  };
  /** Drawn now: three.js stops its own loop when a session starts. */
  stage.state = async () => {
    for (let i = 0; i < 2; i++) await new Promise(requestAnimationFrame);
    stage.renderer.render(stage.scene, stage.camera);
    const canvas = document.querySelector("canvas");
    const { width, height } = canvas;
    const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    copy.drawImage(canvas, 0, 0);
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
