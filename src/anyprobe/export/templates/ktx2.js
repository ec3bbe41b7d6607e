// Gives the .ktx2 beside this file to three.js as a cube map, with its mips.
//
//   import { loadCube } from "./NAME_ktx2.js";
//   scene.background = scene.environment = await loadCube(renderer);
//
// three.js r187's KTX2Loader reads cubes of floats, but hands them over as one flat texture whose
// levels hold the six faces one after the other; this cuts them apart.

import { CompressedCubeTexture, HalfFloatType, LinearFilter, LinearMipmapLinearFilter, LinearSRGBColorSpace, RGBAFormat } from "three";
import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";

const NAME = "@NAME@";

export async function loadCube(renderer, url = new URL(`${encodeURIComponent(NAME)}.ktx2`, import.meta.url).href) {
  const loader = new KTX2Loader().detectSupport(renderer);
  const flat = await loader.loadAsync(url);
  loader.dispose();
  const faces = [0, 1, 2, 3, 4, 5].map((face) => ({
    width: flat.image.width,
    height: flat.image.height,
    mipmaps: flat.mipmaps.map(({ data, width, height }) => {
      const length = 4 * width * height;
      return { data: data.subarray(length * face, length * (face + 1)), width, height };
    }),
  }));
  // three's class of cubes whose mips come from a file, compressed or not
  const cube = new CompressedCubeTexture(faces, RGBAFormat, HalfFloatType);
  cube.colorSpace = LinearSRGBColorSpace;
  cube.magFilter = LinearFilter;
  cube.minFilter = LinearMipmapLinearFilter;
  cube.needsUpdate = true;
  return cube;
}
