/** Virtual spheres on the table of a photo, under its light and behind its vase, in three.js. */

import { AnyProbe } from "anyprobe";
import { ContactShadow, MaskOccluder, ProbeLight, groundShadowOpacity, installCameraCurve } from "anyprobe/three";
import * as THREE from "three";

const PITCH = THREE.MathUtils.degToRad(16); // how far the camera looks down
const FOV_DEG = 32.13; // vertical
const VASE_DISTANCE = 2.34; // in heights of the camera over the table

const probe = await AnyProbe.load();
const light = await probe.estimate("./table.jpg", { mask: "./table-mask.png", fovDeg: FOV_DEG }); // or click: [228, 290]
const { width, height } = light.mask;

const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.shadowMap.enabled = true;
renderer.setSize(width, height);
installCameraCurve(renderer);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(FOV_DEG, width / height); // at the origin: the light is in its frame
const scene = new THREE.Scene();
scene.background = await new THREE.TextureLoader().loadAsync("./table.jpg");
scene.background.colorSpace = THREE.SRGBColorSpace; // shown as it is

const table = new THREE.Group();
table.rotation.x = PITCH;
const up = new THREE.Vector3(0, 1, 0).applyEuler(table.rotation);
table.position.copy(up).negate();
const ground = new THREE.Mesh(new THREE.CircleGeometry(0.78, 64).rotateX(-Math.PI / 2), new THREE.ShadowMaterial({ toneMapped: false }));
ground.position.z = -2.4;
ground.material.opacity = groundShadowOpacity(light, up.toArray());
ground.receiveShadow = true;
table.add(ground);
[[0.06, -2.5, 0, 1], [0.33, -2.05, 0.3, 1], [0.02, -1.85, 0.9, 0]].forEach(([x, z, roughness, metalness]) => {
  const sphere = new THREE.Mesh(new THREE.SphereGeometry(0.12, 64, 32), new THREE.MeshStandardMaterial({ color: 0xdddddd, roughness, metalness }));
  sphere.position.set(x, 0.12, z);
  sphere.castShadow = true;
  const contact = new ContactShadow();
  contact.scale.setScalar(0.26);
  contact.position.set(x, 0.001, z);
  table.add(sphere, contact);
});

const lights = new ProbeLight(probe);
lights.update(light);
lights.position.set(0, 0, -2.4); // the middle of what casts shadows
const { shadow } = lights.directionalLight;
lights.directionalLight.castShadow = true;
Object.assign(shadow.camera, { left: -1, right: 1, top: 1, bottom: -1, near: 4, far: 6 });
Object.assign(shadow, { radius: 4, bias: -0.002 });
shadow.mapSize.set(1024, 1024);
scene.environment = lights.environment;

const vase = new MaskOccluder();
vase.show(light.mask, VASE_DISTANCE, height / 2 / Math.tan(THREE.MathUtils.degToRad(FOV_DEG / 2)));
scene.add(table, lights, vase.group);
renderer.render(scene, camera);
document.body.dataset.light = JSON.stringify(light.dominant.direction);
