// Lights a three.js scene with the light that lies beside this file.
//
//   import { lightScene } from "./NAME_three.js";
//   await lightScene(scene);                    // map for reflections, sun for sharp light
//   await lightScene(scene, { probe: true });   // nine SH numbers instead of the map
//   await lightScene(scene, { sun: false });    // everything from the map
//
// Radiance is linear and relative: tone mapping and exposure are the renderer's.

import {
  Color,
  DirectionalLight,
  EquirectangularReflectionMapping,
  LightProbe,
} from "three";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";

const NAME = "@NAME@";

const beside = (file) => new URL(encodeURIComponent(file), import.meta.url).href;

async function loadMap(file) {
  const map = await new HDRLoader().loadAsync(beside(file));
  map.mapping = EquirectangularReflectionMapping;
  return map;
}

/**
 * background: show the map behind the scene.
 * sun: the main light as a DirectionalLight; map and probe are then those without it,
 *   because it would count twice.
 * probe: light by a LightProbe (matt light only) instead of scene.environment.
 * Returns what was made, to move or dispose of: { light, sun, probe, background, environment }.
 */
export async function lightScene(scene, { background = true, sun = true, probe = false } = {}) {
  const light = await (await fetch(beside(`${NAME}.json`))).json();
  const made = { light };
  if (background || !(sun || probe)) made.background = await loadMap(`${NAME}.hdr`);
  if (background) scene.background = made.background;
  if (probe) {
    made.probe = new LightProbe();
    made.probe.sh.fromArray(sun ? light.sh.ambient : light.sh.full);
    scene.add(made.probe);
  } else {
    made.environment = sun ? await loadMap(`${NAME}_ambient.hdr`) : (made.background ?? (await loadMap(`${NAME}.hdr`)));
    scene.environment = made.environment;
  }
  if (sun) {
    const { x: r, y: g, z: b } = light.primaryLightIntensity;
    const intensity = Math.max(r, g, b);
    const color = intensity > 0 ? new Color(r / intensity, g / intensity, b / intensity) : new Color(1, 1, 1);
    made.sun = new DirectionalLight(color, intensity);
    made.sun.position.copy(light.primaryLightDirection); // its target is the origin
    scene.add(made.sun);
  }
  return made;
}
