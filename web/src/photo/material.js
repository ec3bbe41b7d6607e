/** The object's material, where it is known, as anyprobe.scatter.materials. */

import { CONTRACT } from "../core/contract.js";
import { AnyProbeError } from "../errors.js";
import { shown, wrong } from "../checks.js";

const MATTE = "matte";
const { least_roughness: LEAST_ROUGHNESS, least_reflectance: LEAST_REFLECTANCE } = CONTRACT.materials;

/** Linear albedo, f0 and GGX alpha of the materials that have names. */
export const MATERIALS = { ...CONTRACT.materials.named, ...CONTRACT.materials.measured };

/**
 * @param {import("../../types/index.d.ts").GivenMaterial} given a name of MATERIALS, or what replaces its albedo and roughness
 * @returns {{albedo: number[], f0: number[], alpha: number}}
 */
export function givenMaterial(given) {
  const { name = MATTE, albedo, roughness } = typeof given === "string" ? { name: given } : checkParts(given);
  const known = Object.keys(MATERIALS);
  if (!known.includes(name)) throw wrong("material", `one of ${known.join(", ")}`, name);
  const material = { ...MATERIALS[name] };
  if (roughness !== undefined) {
    if (!(roughness >= LEAST_ROUGHNESS && roughness <= 1)) {
      throw refused("material.roughness", `expected a number from ${LEAST_ROUGHNESS} to 1, got ${roughness}; 0.1 is polished, 1 is matte`);
    }
    material.alpha = roughness ** 2;
  }
  if (albedo !== undefined) {
    const values = typeof albedo === "number" ? [albedo, albedo, albedo] : Array.from(albedo ?? []);
    if (values.length !== 3 || !values.every((value) => value > 0 && value <= 1)) {
      throw refused("material.albedo", `expected one number or three above 0 and up to 1, got ${albedo}; a grey card has 0.18`);
    }
    if (material.albedo.every((value) => value === 0)) {
      throw refused("material.albedo", `expected a material that has one, got the metal ${name}; leave one of them out`);
    }
    material.albedo = values;
  }
  return material;
}

const refused = (subject, text) => new AnyProbeError("invalid-option", text, { subject: [subject] });

const PARTS = ["name", "albedo", "roughness"];

function checkParts(given) {
  const isObject = given !== null && typeof given === "object" && !Array.isArray(given);
  const names = isObject ? Object.keys(given).filter((name) => given[name] !== undefined) : [];
  if (names.length && names.every((name) => PARTS.includes(name))) return given;
  throw refused("material", `expected a name, or an object of ${PARTS.join(", ")}, got ${shown(given)}`);
}

/** A given material as the network takes it; undefined where none is given. */
export function describe(material) {
  return material === undefined ? undefined : materialInput(givenMaterial(material));
}

/** What the network is given of a material, [8]: 1, sqrt(alpha), ln of the total reflectance and f0, each RGB. */
export function materialInput({ albedo, f0, alpha }) {
  const reflected = f0.map((one, channel) => {
    const fresnel = one + (1 - one) / 21;
    return Math.log(Math.max(fresnel + (1 - fresnel) * albedo[channel], LEAST_REFLECTANCE));
  });
  return Float32Array.of(1, Math.sqrt(alpha), ...reflected, ...f0);
}
