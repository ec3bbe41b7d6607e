/** The virtual object's controls: shape, material, own model, turn, size; keys. */

import { element } from "./elements.js";
import { dress, makeMaterial, makeShape, openModel } from "./virtualObjects.js";

const MOVE_SHARE = 0.015;

export class ObjectTools {
  /** @param {import("./photoStage.js").PhotoStage} photoStage */
  constructor(photoStage) {
    this.photoStage = photoStage;
    this.onFault = () => {};
    this.own = null;
    this.shape = element("shape");
    this.material = element("material");
    const { stage } = photoStage;
    element("tools").disabled = !stage.canDraw;
    const bind = (id, set) => {
      element(id).addEventListener("input", (event) => {
        set(Number(event.target.value));
        photoStage.render();
      });
    };
    bind("turn", (turn) => stage.setPose({ turn }));
    bind("size", (size) => stage.setPose({ size }));
    this.shape.addEventListener("change", () => this.#pick());
    this.material.addEventListener("change", () => this.#pick());
    element("model").addEventListener("click", () => element("model-file").click());
    element("model-file").addEventListener("change", (event) => this.#openOwn(event.target));
    photoStage.overlay.addEventListener("keydown", (event) => this.#key(event));
    this.#pick();
  }

  /** Put the chosen shape in the chosen material on the stage. */
  #pick() {
    if (this.shape.value === "own") {
      this.photoStage.stage.setObject(dress(this.own, this.material.value));
    } else {
      if (this.material.value === "own") this.material.value = "chrome";
      this.photoStage.stage.setObject(makeShape(this.shape.value, makeMaterial(this.material.value)));
    }
    this.material.querySelector("[value=own]").hidden = this.shape.value !== "own";
    this.photoStage.render();
  }

  async #openOwn(input) {
    const [file] = input.files;
    input.value = "";
    if (!file) return;
    try {
      this.own = await openModel(file);
    } catch (error) {
      return this.onFault(error);
    }
    const own = this.shape.querySelector("[value=own]") ?? this.shape.appendChild(document.createElement("option"));
    Object.assign(own, { value: "own", textContent: file.name.slice(0, 40) });
    this.shape.value = "own";
    this.material.querySelector("[value=own]").hidden = false;
    this.material.value = "own";
    this.#pick();
  }

  /** Arrows move on the ground, plus and minus scale, comma and full stop turn. */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return; // the browser's own: it zooms by + and -
    const { stage } = this.photoStage;
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (event.key in moves) {
      const [dx, dy] = moves[event.key].map((value) => value * MOVE_SHARE * stage.width);
      const [x, y] = stage.footPx();
      stage.moveTo(x + dx, y + dy);
    } else if (event.key === "+" || event.key === "=") this.#slide("size", 0.05);
    else if (event.key === "-") this.#slide("size", -0.05);
    else if (event.key === ",") this.#slide("turn", -5);
    else if (event.key === ".") this.#slide("turn", 5);
    else return;
    event.preventDefault();
    this.photoStage.render();
  }

  #slide(id, by) {
    const slider = element(id);
    slider.value = Number(slider.value) + by;
    slider.dispatchEvent(new Event("input"));
  }
}
