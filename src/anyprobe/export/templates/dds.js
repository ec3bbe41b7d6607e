// Gives the BC6H .dds beside this file to three.js as a cube map, with its mips.
//
//   import { loadCube } from "./NAME_dds.js";
//   scene.background = scene.environment = await loadCube(renderer);
//
// It needs the extension EXT_texture_compression_bptc, which desktop graphics cards have.

import { CompressedCubeTexture, LinearFilter, LinearMipmapLinearFilter, LinearSRGBColorSpace } from "three";
import { DDSLoader } from "three/addons/loaders/DDSLoader.js";

const NAME = "@NAME@";

export async function loadCube(renderer, url = new URL(`${encodeURIComponent(NAME)}_bc6h.dds`, import.meta.url).href) {
  if (!renderer.extensions.has("EXT_texture_compression_bptc")) throw new Error("BC6H is not supported here");
  const loaded = await new DDSLoader().loadAsync(url); // its class is not that of a cube
  const cube = new CompressedCubeTexture(loaded.image, loaded.format, loaded.type);
  cube.colorSpace = LinearSRGBColorSpace;
  cube.magFilter = LinearFilter;
  cube.minFilter = LinearMipmapLinearFilter;
  cube.needsUpdate = true;
  return cube;
}
