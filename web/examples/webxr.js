/**
 * Nine spheres whose light is the default one until an estimate begins, as three.js's webxr_ar_lighting has them; a video
 * stands in the place of the session's camera.
 */

import { AnyProbe } from "anyprobe";
import { ProbeLight, installCameraCurve } from "anyprobe/three";
import { HemisphereLight, Mesh, MeshStandardMaterial, PerspectiveCamera, Scene, SphereGeometry, WebGLRenderer } from "three";

const video = Object.assign(document.createElement("video"), { muted: true, loop: true, playsInline: true });
video.srcObject = await navigator.mediaDevices.getUserMedia({ video: { facingMode: "environment" } });
await video.play();

const renderer = new WebGLRenderer({ alpha: true, preserveDrawingBuffer: true });
installCameraCurve(renderer);
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const scene = new Scene();
const camera = new PerspectiveCamera(70, innerWidth / innerHeight, 0.01, 20);
const defaultLight = new HemisphereLight(0xffffff, 0xbbbbff, 1);
scene.add(defaultLight);

const geometry = new SphereGeometry(0.175, 32, 32);
for (let i = 0; i < 9; i++) {
  const [column, row] = [i % 3, Math.floor(i / 3)];
  const material = new MeshStandardMaterial({ color: 0xdddddd, roughness: column / 3, metalness: row / 3 });
  const sphere = new Mesh(geometry, material);
  sphere.position.set(0.4 * (column - 1), 0.4 * (row - 1), -2);
  scene.add(sphere);
}

const xrLight = new ProbeLight(await AnyProbe.load());
xrLight.addEventListener("estimationstart", () => {
  scene.add(xrLight);
  scene.remove(defaultLight);
  if (xrLight.environment) scene.environment = xrLight.environment;
});
xrLight.addEventListener("estimationend", () => {
  scene.add(defaultLight);
  scene.remove(xrLight);
  scene.environment = null;
});
xrLight.track(video, { click: [0.5 * video.videoWidth, 0.55 * video.videoHeight] });

renderer.setAnimationLoop(() => {
  renderer.render(scene, camera);
  if (xrLight.estimate) document.body.dataset.light = JSON.stringify(xrLight.estimate.dominant.direction);
});
document.addEventListener("click", () => xrLight.stop());
