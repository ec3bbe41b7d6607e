/** Virtual spheres on the table of a photo, under its light and behind its vase, in Babylon.js. */

import * as BABYLON from "@babylonjs/core";
import { AnyProbe, EXPONENT, SIGMA, encodeHdr, groundShadowOpacity } from "anyprobe";

const PITCH = (16 * Math.PI) / 180; // how far the camera looks down
const UP = [0, Math.cos(PITCH), Math.sin(PITCH)];
const FOV_DEG = 32.13; // vertical
const VASE_DISTANCE = 2.4; // in heights of the camera over the table, of its middle

const probe = await AnyProbe.load();
const light = await probe.estimate("./table.jpg", { mask: "./table-mask.png", fovDeg: FOV_DEG }); // or click: [228, 290]
const { width, height, data } = light.mask;

const canvas = Object.assign(document.createElement("canvas"), { width, height });
document.body.append(canvas);
const engine = new BABYLON.Engine(canvas, true, { preserveDrawingBuffer: true });
const scene = new BABYLON.Scene(engine);
scene.useRightHandedSystem = true; // as the light
scene.imageProcessingConfiguration.applyByPostProcess = true; // none: materials end in the camera's curve
scene.setRenderingAutoClearDepthStencil(1, false); // the real vase, in group 0, hides what is in group 1
const camera = new BABYLON.FreeCamera("camera", BABYLON.Vector3.Zero(), scene); // at the origin: the light is in its frame
camera.setTarget(new BABYLON.Vector3(0, 0, -1));
Object.assign(camera, { fov: (FOV_DEG * Math.PI) / 180, minZ: 0.1 });
new BABYLON.Layer("photo", "./table.jpg", scene, true);
const map = URL.createObjectURL(new Blob([encodeHdr(light.radiance, 64)]));
scene.environmentTexture = new BABYLON.HDRCubeTexture(map, scene, 128, false, true, false, true);

class CameraCurve extends BABYLON.MaterialPluginBase {
  constructor(material) {
    super(material, "CameraCurve", 200, { CAMERACURVE: false });
    this._enable(true);
  }
  getCustomCode(stage) {
    const curve = `vec3 x = pow(clamp(finalColor.rgb, 0., 1.), vec3(${EXPONENT}));
      finalColor.rgb = ${1 + SIGMA} * x / (x + ${SIGMA});`;
    return stage === "fragment" ? { CUSTOM_FRAGMENT_BEFORE_FRAGCOLOR: curve } : null;
  }
}

// casts shadows alone: the environment holds the dominant light too
const sun = new BABYLON.DirectionalLight("dominant", new BABYLON.Vector3(...light.dominant.direction).negate(), scene);
Object.assign(sun, { intensity: 0, shadowFrustumSize: 2.5, shadowMinZ: 1, shadowMaxZ: 5 });
sun.position = new BABYLON.Vector3(...light.dominant.direction).scale(3).add(new BABYLON.Vector3(0, -0.4, -2.4));
const shadows = new BABYLON.ShadowGenerator(1024, sun);
Object.assign(shadows, { usePercentageCloserFiltering: true, bias: 0.002 });

const table = new BABYLON.TransformNode("table", scene);
table.rotation.x = PITCH;
table.position.set(...UP.map((value) => -value));
for (const [x, z, roughness, metallic] of [[0.06, -2.5, 0, 1], [0.33, -2.05, 0.3, 1], [0.02, -1.85, 0.9, 0]]) {
  const sphere = BABYLON.CreateSphere("sphere", { diameter: 0.24, segments: 64 }, scene);
  Object.assign(sphere, { parent: table, position: new BABYLON.Vector3(x, 0.12, z), renderingGroupId: 1 });
  sphere.material = new BABYLON.PBRMaterial("material", scene);
  Object.assign(sphere.material, { metallic, roughness, albedoColor: BABYLON.Color3.FromHexString("#dddddd").toLinearSpace() });
  new CameraCurve(sphere.material);
  shadows.addShadowCaster(sphere);
}
const ground = BABYLON.CreateDisc("ground", { radius: 0.78, sideOrientation: BABYLON.Mesh.DOUBLESIDE }, scene);
Object.assign(ground, { parent: table, position: new BABYLON.Vector3(0, 0, -2.4), receiveShadows: true, renderingGroupId: 1 });
ground.rotation.x = -Math.PI / 2;
ground.material = new BABYLON.BackgroundMaterial("shadow", scene);
Object.assign(ground.material, { shadowOnly: true, alpha: groundShadowOpacity(light, UP), primaryColor: BABYLON.Color3.Black() });

const vase = BABYLON.CreatePlane("vase", { height: 2 * VASE_DISTANCE * Math.tan(camera.fov / 2), width: (2 * VASE_DISTANCE * Math.tan(camera.fov / 2) * width) / height, sideOrientation: BABYLON.Mesh.DOUBLESIDE }, scene);
vase.position.z = -VASE_DISTANCE;
const opaque = Uint8Array.from({ length: 4 * data.length }, (_, i) => 255 * data[(height - 1 - Math.floor((i >> 2) / width)) * width + ((i >> 2) % width)]);
vase.material = new BABYLON.StandardMaterial("mask", scene);
const mask = BABYLON.RawTexture.CreateRGBATexture(opaque, width, height, scene, false);
mask.hasAlpha = true;
Object.assign(vase.material, { diffuseTexture: mask, transparencyMode: BABYLON.Material.MATERIAL_ALPHATEST, alphaCutOff: 0.5, useAlphaFromDiffuseTexture: true, disableColorWrite: true });

await scene.whenReadyAsync();
scene.render();
document.body.dataset.light = JSON.stringify(light.dominant.direction);
