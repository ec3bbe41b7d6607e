/** Spheres in augmented reality as three.js's webxr_ar_lighting lights them; by the camera's picture in the place of what the session estimates. */

import { AnyProbe } from "anyprobe";
import { ProbeLight, installCameraCurve } from "anyprobe/three";
import * as THREE from "three";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { ARButton } from "three/addons/webxr/ARButton.js";

const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
renderer.setSize(innerWidth, innerHeight);
renderer.xr.enabled = true;
renderer.shadowMap.enabled = true;
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(70, innerWidth / innerHeight, 0.01, 20);
const defaultEnvironment = new THREE.PMREMGenerator(renderer).fromScene(new RoomEnvironment()).texture;
const defaultLight = new THREE.HemisphereLight(0xffffff, 0xbbbbff, 1);
defaultLight.position.set(0.5, 1, 0.25);
scene.add(defaultLight);
scene.environment = defaultEnvironment;

const xrLight = new ProbeLight(await AnyProbe.load());
installCameraCurve(renderer);
renderer.xr.addEventListener("sessionend", () => xrLight.stop());
xrLight.addEventListener("estimationstart", () => {
  scene.add(xrLight);
  scene.remove(defaultLight);
  if (xrLight.environment) scene.environment = xrLight.environment;
});
xrLight.addEventListener("estimationend", () => {
  scene.add(defaultLight);
  scene.remove(xrLight);
  scene.environment = defaultEnvironment;
});

const group = new THREE.Group();
group.position.z = -2;
const geometry = new THREE.SphereGeometry(0.175, 32, 32);
for (let i = 0; i < 9; i++) {
  const [row, column] = [Math.floor(i / 3), i % 3];
  const material = new THREE.MeshStandardMaterial({ color: 0xdddddd, roughness: row / 3, metalness: column / 3 });
  const sphere = new THREE.Mesh(geometry, material);
  sphere.castShadow = true;
  sphere.position.set(0.4 * (row - 1), 0.4 * (column - 1), 0);
  group.add(sphere);
}
const controller = renderer.xr.getController(0);
// below the spheres the shadow of the dominant light, of three.js's estimate as of ours
const ground = new THREE.Mesh(new THREE.PlaneGeometry(3, 3).rotateX(-Math.PI / 2), new THREE.ShadowMaterial({ opacity: 0.4 }));
ground.receiveShadow = true;
xrLight.directionalLight.castShadow = true;
function place(matrix) {
  group.position.set(0, 0, -2).applyMatrix4(matrix);
  ground.position.copy(group.position).y -= 0.6;
}
place(controller.matrixWorld);
controller.addEventListener("select", () => {
  place(controller.matrixWorld);
  xrLight.mark(controller).catch(console.warn); // the object that is tapped on is the probe
});
scene.add(group, ground, controller);
// with depth, three.js itself hides what stands behind real things
const depthSensing = { usagePreference: ["gpu-optimized"], dataFormatPreference: ["luminance-alpha", "float32"] };
document.body.append(
  ARButton.createButton(renderer, {
    requiredFeatures: ["camera-access"],
    optionalFeatures: ["depth-sensing"],
    depthSensing,
  }),
);

renderer.setAnimationLoop((time, frame) => {
  xrLight.offerCamera(renderer, frame);
  renderer.render(scene, camera);
});
addEventListener("resize", () => {
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
});
