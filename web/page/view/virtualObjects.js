/** What can stand beside the real object: shapes one unit high on the ground, materials, own .glb files. */

import { Box3, Group, Mesh, MeshStandardMaterial, Vector3 } from "three";
import { clone } from "three/addons/utils/SkeletonUtils.js";
import { SHAPES } from "./shapes.js";

/** Materials of the picker, as anyprobe.scatter.materials: colours are linear reflectances, roughness the root of alpha. */
export const MATERIALS = {
  chrome: { color: [0.549, 0.556, 0.554], metalness: 1, roughness: Math.sqrt(0.03) },
  gold: { color: [1, 0.77, 0.34], metalness: 1, roughness: Math.sqrt(0.12) },
  plastic: { color: [0.52, 0.06, 0.05], metalness: 0, roughness: Math.sqrt(0.12) },
  matte: { color: [0.3, 0.3, 0.3], metalness: 0, roughness: Math.sqrt(0.9) },
};

export function makeMaterial(name) {
  const { color, ...rest } = MATERIALS[name];
  const material = new MeshStandardMaterial(rest);
  material.color.setRGB(...color);
  return material;
}

/** A shape of the picker, standing on the ground. */
export function makeShape(name, material) {
  const mesh = new Mesh(SHAPES[name](), material);
  return stand(new Group().add(mesh));
}

/** A model of the user's own; nothing is fetched but the file itself. */
export async function openModel(file) {
  const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
  let scene;
  try {
    ({ scene } = await new GLTFLoader().parseAsync(await file.arrayBuffer(), ""));
  } catch (error) {
    throw new Error(`${file.name}: expected a .glb model that needs no other file (${error.message}).`);
  }
  if (!scene?.getObjectByProperty("isMesh", true)) throw new Error(`${file.name}: this model has no surface to show.`);
  return stand(new Group().add(scene));
}

/** A copy of a model, its skeleton's too, in its own materials ("own") or one of the picker's; whoever shows it frees it. */
export function dress(model, name) {
  const copy = clone(model);
  copy.traverse((part) => {
    if (!part.isMesh) return;
    part.geometry = part.geometry.clone();
    part.material = name === "own" ? part.material.clone() : makeMaterial(name);
  });
  return copy;
}

/** Scale a group to height 1 (or to that size, lying things) and put it on the ground, origin below it. */
function stand(group) {
  const box = new Box3().setFromObject(group);
  const size = box.getSize(new Vector3());
  const scale = 1 / Math.max(size.y, 0.6 * Math.max(size.x, size.z), 1e-6);
  const middle = box.getCenter(new Vector3());
  const inner = group.children[0];
  inner.scale.multiplyScalar(scale);
  inner.position.sub(new Vector3(middle.x, box.min.y, middle.z)).multiplyScalar(scale);
  group.traverse((part) => {
    if (part.isMesh) part.castShadow = true;
  });
  group.userData.width = scale * Math.max(size.x, size.z);
  return group;
}

/** Free what a group holds on the GPU; textures that a copy shares with its model are sent there again with the next one. */
export function dispose(group) {
  group.traverse((part) => {
    part.geometry?.dispose();
    part.skeleton?.dispose();
    for (const material of [part.material ?? []].flat()) {
      for (const value of Object.values(material)) if (value?.isTexture) value.dispose();
      material.dispose();
    }
  });
}
