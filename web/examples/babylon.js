/** A gold sphere under the light of a photo, in Babylon.js. */

import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { DirectionalLight } from "@babylonjs/core/Lights/directionalLight.js";
import { PBRMaterial } from "@babylonjs/core/Materials/PBR/pbrMaterial.js";
import { HDRCubeTexture } from "@babylonjs/core/Materials/Textures/hdrCubeTexture.js";
import { Color3 } from "@babylonjs/core/Maths/math.color.js";
import { Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { CreateSphere } from "@babylonjs/core/Meshes/Builders/sphereBuilder.js";
import { Scene } from "@babylonjs/core/scene.js";
import { AnyProbe, encodeHdr } from "anyprobe";

const photo = new Image();
photo.src = "./vase.png";
await photo.decode();
const probe = await AnyProbe.load();
const light = await probe.estimate(photo, { fovDeg: 24 });

const canvas = Object.assign(document.createElement("canvas"), { width: 480, height: 480 });
document.body.append(canvas);
const engine = new Engine(canvas, true, { preserveDrawingBuffer: true });
const scene = new Scene(engine);
scene.useRightHandedSystem = true; // as the light
const file = new Blob([encodeHdr(light.radiance, 64)]);
scene.environmentTexture = new HDRCubeTexture(URL.createObjectURL(file), scene, 128, false, true, false, true);

const sphere = CreateSphere("sphere", { diameter: 2, segments: 64 }, scene);
sphere.position.set(0, 0, -5);
sphere.material = new PBRMaterial("gold", scene);
Object.assign(sphere.material, { metallic: 1, roughness: 0.35, albedoColor: new Color3(1, 0.77, 0.34) });

// casts shadows alone: the environment holds the dominant light too
const { direction } = light.dominant;
new DirectionalLight("dominant", new Vector3(...direction).negate(), scene).intensity = 0;

const camera = new FreeCamera("camera", Vector3.Zero(), scene);
camera.setTarget(new Vector3(0, 0, -1));
camera.fov = 0.5;
await scene.whenReadyAsync();
scene.render();
document.body.dataset.light = JSON.stringify(direction);
