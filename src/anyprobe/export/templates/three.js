// Lights a three.js scene with the light that lies beside this file.
//
//   import { lightScene } from "./NAME_three.js";
//   await lightScene(scene);                    // map for reflections, suns for sharp light
//   await lightScene(scene, { probe: true });   // nine SH numbers instead of the map
//   await lightScene(scene, { suns: false });   // everything from the map
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
 * suns: each light source as a DirectionalLight, its diameter in userData.angleDeg; map and probe are then those
 *   without them, because they would count twice.
 * probe: light by a LightProbe (matt light only) instead of scene.environment.
 * Returns what was made, to move or dispose of: { light, suns, probe, background, environment }.
 */
export async function lightScene(scene, { background = true, suns = true, probe = false } = {}) {
  const light = await (await fetch(beside(`${NAME}.json`))).json();
  const made = { light, suns: [] };
  if (background || !(suns || probe)) made.background = await loadMap(`${NAME}.hdr`);
  if (background) scene.background = made.background;
  if (probe) {
    made.probe = new LightProbe();
    made.probe.sh.fromArray(suns ? light.sh.ambient : light.sh.full);
    scene.add(made.probe);
  } else {
    made.environment = suns ? await loadMap(`${NAME}_ambient.hdr`) : (made.background ?? (await loadMap(`${NAME}.hdr`)));
    scene.environment = made.environment;
  }
  for (const { direction, irradiance, angle_deg: angleDeg } of suns ? light.lights : []) {
    const intensity = Math.max(...irradiance);
    if (intensity === 0) continue;
    const [r, g, b] = irradiance.map((value) => value / intensity);
    const sun = new DirectionalLight(new Color(r, g, b), intensity);
    sun.position.fromArray(direction); // its target is the origin
    sun.userData.angleDeg = angleDeg;
    made.suns.push(sun);
    scene.add(sun);
  }
  return made;
}
