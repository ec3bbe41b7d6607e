/** A model of one's own is seen whatever holds its surface, and leaves nothing on the GPU. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { Group, Mesh, MeshStandardMaterial, SphereGeometry, Texture } from "three";

import { outlineOf } from "../page/view/outline.js";
import { dispose, dress, openModel } from "../page/view/virtualObjects.js";

/** A file of the format's two chunks. */
function glb(document, body = new Uint8Array(0)) {
  const text = new TextEncoder().encode(JSON.stringify(document));
  const json = new Uint8Array(Math.ceil(text.length / 4) * 4).fill(32);
  json.set(text);
  const chunk = (kind, bytes) => [Uint32Array.of(bytes.length), new TextEncoder().encode(kind), bytes];
  const chunks = [...chunk("JSON", json), ...(body.length ? chunk("BIN\0", body) : [])];
  const length = 12 + chunks.reduce((sum, part) => sum + part.byteLength, 0);
  return new File([new TextEncoder().encode("glTF"), Uint32Array.of(2, length), ...chunks], "own.glb");
}

/** A triangle two wide and one high; a bone that stands ten to the right of the scene's middle holds all of it. */
function rigged() {
  const parts = [
    [5126, "VEC3", Float32Array.of(-1, 0, 0, 1, 0, 0, 0, 1, 0)],
    [5123, "VEC4", new Uint16Array(12)],
    [5126, "VEC4", Float32Array.of(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)],
  ];
  const body = new Uint8Array(parts.reduce((sum, [, , values]) => sum + values.byteLength, 0));
  const bufferViews = [];
  const accessors = [];
  let byteOffset = 0;
  for (const [componentType, type, values] of parts) {
    body.set(new Uint8Array(values.buffer), byteOffset);
    accessors.push({ bufferView: bufferViews.length, componentType, count: 3, type });
    bufferViews.push({ buffer: 0, byteOffset, byteLength: values.byteLength });
    byteOffset += values.byteLength;
  }
  Object.assign(accessors[0], { min: [-1, 0, 0], max: [1, 1, 0] });
  const attributes = { POSITION: 0, JOINTS_0: 1, WEIGHTS_0: 2 };
  return glb(
    {
      asset: { version: "2.0" },
      scene: 0,
      scenes: [{ nodes: [0, 1] }],
      nodes: [{ mesh: 0, skin: 0, translation: [5, 0, 0] }, { translation: [10, 0, 0] }],
      skins: [{ joints: [1] }],
      meshes: [{ primitives: [{ attributes }] }],
      buffers: [{ byteLength: body.length }],
      bufferViews,
      accessors,
    },
    body,
  );
}

test("a rigged model stands on the ground, and so do its copies, each with bones of its own", async () => {
  const model = await openModel(rigged());
  for (const material of ["own", "chrome"]) {
    const copy = dress(model, material);
    const skinned = copy.getObjectByProperty("isSkinnedMesh", true);
    const { bones } = skinned.skeleton;
    const parents = [];
    bones[0].traverseAncestors((parent) => parents.push(parent));
    assert.ok(parents.includes(copy));
    const outline = outlineOf(copy);
    const [xs, ys] = [0, 1].map((axis) => outline.filter((_, i) => i % 3 === axis));
    const bounds = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const half = 0.5 / 0.6; // lying things are brought to a width of one over 0.6
    for (const [i, expected] of [-half, half, 0, half].entries()) {
      assert.ok(Math.abs(bounds[i] - expected) < 1e-5, `${material}: ${bounds}`);
    }
  }
});

test("a model without a surface is refused in one line", async () => {
  const asset = { version: "2.0" };
  for (const document of [{ asset, scene: 0, scenes: [{ nodes: [0] }], nodes: [{}] }, { asset }]) {
    await assert.rejects(openModel(glb(document)), /^Error: own\.glb: this model has no surface to show\.$/);
  }
});

test("what is shown no longer frees the textures of its own material, and no others", () => {
  const freed = [];
  const texture = (name) => {
    const made = new Texture();
    made.addEventListener("dispose", () => freed.push(name));
    return made;
  };
  const material = new MeshStandardMaterial({ map: texture("map"), normalMap: texture("normals") });
  const model = new Group().add(new Mesh(new SphereGeometry(), material));
  dispose(dress(model, "gold"));
  assert.deepEqual(freed, []);
  dispose(dress(model, "own"));
  assert.deepEqual(freed, ["map", "normals"]);
});
