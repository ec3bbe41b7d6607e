/** The types as programs use them: npm run types. */

import { Mesh, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { AnyProbe, AnyProbeError, Light, encodeHdr, irradiance } from "anyprobe";
import { AnyProbe as Core } from "anyprobe/core";
import { encodeExr } from "anyprobe/exr";
import type { XREstimatedLight } from "three/addons/webxr/XREstimatedLight.js";
import { ContactShadow, EnvironmentTexture, MaskOccluder, ProbeLight, groundShadowOpacity, installCameraCurve } from "anyprobe/three";

export async function use(image: HTMLImageElement, video: HTMLVideoElement, scene: Scene, renderer: WebGLRenderer) {
  const probe = await AnyProbe.load({ threads: 2 });
  const light: Light = await probe.estimate(image, { click: [10, 20], exclude: [[1, 2], [3, 4]] });
  const [r]: [number, number, number] = irradiance(light.sh9, [0, 1, 0]);
  const { width, data } = new Light(structuredClone(light)).environment;
  const [{ direction, irradiance: E, color, power, radiusDeg, exists, errorDeg } = light.dominant] = light.sources;
  const [x]: [number, number, number] = direction.map((value, i) => value + E[i] + color[i] + power[i]) as typeof direction;
  const numbers: number[] = [x, radiusDeg, exists, errorDeg, light.directionality, light.uncertainty.levelStops];
  new Blob([encodeHdr(light.radiance, 64), await encodeExr(light.radiance, 64)]);
  const tracker = probe.track(video, ({ dominant }) => dominant.direction[0], { box: [0, 0, 9, 9], onLost: () => {}, onError: ({ code }) => code === "failed" });
  await tracker.mark({ click: [1, 2] });
  await tracker.set({ material: "chrome" });
  const places = [[1, 2], [3, 4]] as const;
  await probe.estimate(image, { mask: await probe.mask(image, { click: places, box: null }) });
  await probe.estimate(image, { mask: light.mask ?? undefined });
  new MaskOccluder().show(await probe.mask(image), 5, 500);
  await tracker.offer(image, { time: performance.now() });
  tracker.stop();

  installCameraCurve(renderer);
  const lights = new ProbeLight(probe);
  const estimated: XREstimatedLight | ProbeLight = lights;
  const inItsPlace: XREstimatedLight = estimated;
  lights.addEventListener("estimationstart", () => (scene.environment = lights.environment));
  lights.directionalLight.castShadow = true;
  lights.update(light, new PerspectiveCamera());
  lights.track(video, { surroundings: true });
  lights.track(new MediaStream());
  await AnyProbe.load({ weights: { u2netp: "u2netp.onnx" } });
  await AnyProbe.load({ weights: { light: new Uint8Array(1), mask: "mask.onnx" } });
  const shadow: Mesh = new ContactShadow(0.4);
  scene.add(lights, shadow, new MaskOccluder().group);
  scene.environment = new EnvironmentTexture().update(light.prefiltered);
  await Core.load({ weights: { light: "light.onnx" }, runtime: new URL("ort/", "https://localhost/") });
  await AnyProbe.load({ signal: AbortSignal.timeout(9), onProgress: ({ loaded, total, stalled }) => [loaded + (total ?? 0), stalled] });
  const { projectionMatrix } = new PerspectiveCamera();
  const found = await probe.estimate(new Blob(), { projectionMatrix, signal: new AbortController().signal });
  if (found.mask) new MaskOccluder().show(found.mask, 5, 500);
  const code: "disposed" | string = new AnyProbeError("disposed", "").code;
  // @ts-expect-error the core has no weights of its own
  await Core.load({});
  // @ts-expect-error nor has it a light
  await Core.load({ weights: { u2netp: "u2netp.onnx" }, runtime: "ort/" });
  // @ts-expect-error a misspelt option
  await probe.estimate(image, { fov: 30 });
  // @ts-expect-error there is no such code
  new AnyProbeError("broken", code);
  // @ts-expect-error a picture is needed
  await probe.estimate(null);
  // @ts-expect-error there is no such option
  await AnyProbe.load({ engine: "webgl" });
  // @ts-expect-error a click is two numbers
  await probe.estimate(image, { click: 3 });
  return [r + width + data.length + numbers.length, groundShadowOpacity(light, [0, 1, 0])];
}
