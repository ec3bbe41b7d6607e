/** The light beside the photo: map, dominant light, spheres, downloads. */

import { OWN_FILES, exportTarget, save } from "../downloads.js";
import { element, setStatus } from "./elements.js";
import { errorLine } from "../words.js";
import { brightestSide, sideOf } from "../../src/light/light.js";
import { describeDirection, drawMap, drawSphere, placeOnMap } from "./pictures.js";
import { SPHERE_NAMES, shadeSpheres, unclippedEv } from "./spheres.js";

const TITLES = {
  three: "three.js",
  webxr: "WebXR",
  usd: "USD",
  gltf: "glTF",
  ultrahdr: "Ultra HDR",
  cube: "cube map",
  ktx2: "KTX2",
};

const AS_SHOWN = "The map as it is shown above, with its exposure or false colour; radiance is in .exr and .hdr";

/** An error [degrees] beyond which a direction says no more than a side. */
const DOUBTED_DEG = 45;

export class LightPanel {
  constructor(config) {
    this.result = this.shaded = null;
    this.spheres = Object.fromEntries(SPHERE_NAMES.map((name) => [name, element(`sphere-${name}`)]));
    this.exposure = element("exposure");
    this.falseColor = element("false-color");
    this.exposure.addEventListener("input", () => {
      this.#drawMap();
      this.#drawSpheres();
    });
    this.falseColor.addEventListener("change", () => this.#drawMap());
    this.#addDownloads(config);
    element("about").textContent = `anyprobe ${config.version}, model ${config.model}.`;
    element("api").hidden = !config.server;
  }

  /** @param {{light: import("../../src/light/light.js").Light}} result @param {object} about photo, model, longFovDeg */
  show(result, about) {
    Object.assign(this, { result, about, shaded: shadeSpheres(result.light.radiance) });
    this.#drawMap();
    this.#drawSpheres();
    const { isSoft, uncertainty, dominant: { direction, irradiance } } = result.light;
    const [isDark, marker] = [Math.max(...irradiance) === 0, element("marker")];
    marker.hidden = isDark || isSoft;
    Object.assign(marker.style, placeOnMap(direction));
    element("direction").textContent = isDark ? "none stands out" : described(result.light);
    element("brightness").textContent = uncertainty ? `, brightness ± ${uncertainty.levelStops.toFixed(1)} stops` : "";
    this.#setReady(true);
  }

  /** Clear the panel. */
  clear() {
    this.result = this.shaded = null;
    for (const canvas of [element("map"), ...Object.values(this.spheres)]) {
      canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
    }
    element("marker").hidden = true;
    element("direction").textContent = "not yet known";
    element("brightness").textContent = "";
    this.#setReady(false);
  }

  #setReady(isReady) {
    for (const button of document.querySelectorAll("#downloads button, #export")) button.disabled = !isReady;
  }

  #drawSpheres() {
    if (!this.shaded) return;
    const exposureEv = Number(this.exposure.value) + unclippedEv(this.shaded);
    for (const name of SPHERE_NAMES) drawSphere(this.spheres[name], this.shaded[name], exposureEv);
  }

  #drawMap() {
    const exposure = Number(this.exposure.value);
    element("exposure-value").textContent = `${exposure.toFixed(1).replace("-", "−")} EV`;
    if (this.result) drawMap(element("map"), this.result.light.radiance, exposure, this.falseColor.checked);
  }

  #addDownloads({ server, targets }) {
    for (const kind of Object.keys(OWN_FILES)) {
      this.#addButton(`.${kind}`, () => OWN_FILES[kind](this.result, this.about), kind);
    }
    this.#addButton(".png", () => new Promise((done) => element("map").toBlob(done)), "png", AS_SHOWN);
    element("targets-row").hidden = !server;
    for (const target of targets) {
      element("targets").add(new Option(TITLES[target] ?? target[0].toUpperCase() + target.slice(1), target));
    }
    element("export").disabled = true;
    element("export").addEventListener("click", () => {
      const target = element("targets").value;
      this.#save(() => exportTarget(this.result, target, this.about), `${target}.zip`);
    });
  }

  #addButton(text, make, suffix, title = "") {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: text, title, disabled: true });
    button.setAttribute("aria-label", `Download the map as ${text}`);
    button.addEventListener("click", () => this.#save(make, suffix));
    element("downloads").append(button);
  }

  async #save(make, suffix) {
    try {
      save(await make(), suffix === "zip" ? suffix : `${this.about.photo}.${suffix}`);
    } catch (error) {
      setStatus(errorLine(error), "fault");
    }
  }
}

/** Where light comes from, in the command line's words. */
function described(light) {
  const { isSoft, ground, dominant: { direction, errorDeg } } = light;
  if (isSoft) return `soft, brightest from ${brightestSide(light)}`;
  const where = errorDeg > DOUBTED_DEG ? `probably from ${sideOf(direction, ground)}` : describeDirection(direction, ground);
  return `${where} ±\u00a0${Math.round(errorDeg)}°`;
}
