/** Virtual spheres on the table of a photo, under its light and behind its vase, in three.js. */

import { AnyProbe } from "anyprobe";
import { MaskOccluder, PhotoGround, ProbeLight, installCameraCurve } from "anyprobe/three";
import * as THREE from "three";

const probe = await AnyProbe.load();
const light = await probe.estimate("./table.jpg", { mask: "./table-mask.png", fovDeg: 32.13, pitchDeg: 16 }); // or click: [228, 290]
const { width, height } = light.mask;

const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(width, height);
renderer.shadowMap.enabled = true;
installCameraCurve(renderer); // radiance is shown as the photo's camera shows it
document.body.append(renderer.domElement);
const camera = PhotoGround.camera(light); // of fovDeg, or as the file notes it, or a phone's; at the origin: the light is in its frame
const scene = new THREE.Scene();
scene.background = await new THREE.TextureLoader().loadAsync("./table.jpg");
scene.background.colorSpace = THREE.SRGBColorSpace;

const ground = new PhotoGround(light, camera); // sizes are in heights of the vase
[[339, 325, 0, 1], [442, 387, 0.3, 1], [328, 423, 0.9, 0]].forEach(([x, y, roughness, metalness]) => {
  const material = new THREE.MeshStandardMaterial({ color: 0xdddddd, roughness, metalness });
  ground.stand(new THREE.Mesh(new THREE.SphereGeometry(0.16, 64, 32), material), [x, y]); // at a pixel of the photo
});
const lights = new ProbeLight(probe);
lights.update(light);
scene.environment = lights.environment; // all of the light but the dominant one, which casts the shadows
ground.castFrom(lights);
const vase = new MaskOccluder(); // hides what stands behind the vase
vase.show(light.mask, ground.distance, ground.focalPx);
scene.add(ground, lights, vase.group);
renderer.render(scene, camera);
document.body.dataset.light = JSON.stringify(light.dominant.direction);
