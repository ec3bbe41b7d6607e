// Chrome, gold and white spheres under the light of a photo, drawn by three.js and by Python (test_npm_package.py).

import { AnyProbe } from "anyprobe";
import { EnvironmentTexture, installCameraCurve } from "anyprobe/three";
import { Mesh, MeshStandardMaterial, PerspectiveCamera, Scene, SphereGeometry, WebGLRenderer } from "three";

const photo = new Image();
photo.src = "./vase.png"; // its transparency is the mask
await photo.decode();
const probe = await AnyProbe.load();
const light = await probe.estimate(photo, { fovDeg: 24 });

const renderer = new WebGLRenderer({ alpha: true, preserveDrawingBuffer: true });
installCameraCurve(renderer);
renderer.setSize(720, 240);
document.body.append(renderer.domElement);

const scene = new Scene();
scene.environment = new EnvironmentTexture().update(light.prefiltered);
const materials = [
  { color: [0.549, 0.556, 0.554], metalness: 1, roughness: 0.173 },
  { color: [1, 0.77, 0.34], metalness: 1, roughness: 0.346 },
  { color: [0.3, 0.3, 0.3], metalness: 0, roughness: 0.949 },
];
materials.forEach(({ color, ...rest }, i) => {
  const sphere = new Mesh(new SphereGeometry(1, 64, 32), new MeshStandardMaterial(rest));
  sphere.material.color.setRGB(...color);
  sphere.position.set(2.4 * (i - 1), 0, -9);
  scene.add(sphere);
});
renderer.render(scene, new PerspectiveCamera(18, 3));
document.body.dataset.light = JSON.stringify(light.dominant.direction);
