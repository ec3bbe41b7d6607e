/** The photo or the camera's picture, the virtual object over it, and the line between before and after. */

import { Stage } from "./stage.js";
import { element, setStatus } from "./elements.js";
import { putRgba } from "./pictures.js";

/** Diameter of the knob that divides before from after, as style.css has it. */
const KNOB = "2rem";

export class PhotoStage {
  constructor() {
    this.canvas = element("photo");
    this.video = element("video");
    this.overlay = element("overlay");
    this.frame = element("frame");
    this.stage = new Stage(this.overlay);
    this.cut = 0; // share of the picture's width that shows the photo without the object
    for (const part of [this.overlay, element("before")]) part.hidden = !this.stage.canDraw;
    this.#listen();
  }

  showPicture({ width, height, rgba }) {
    this.video.hidden = true;
    this.canvas.hidden = false;
    putRgba(this.canvas, rgba, width, height);
    this.#fit(width, height);
    this.stage.isLive = false;
    this.#hide();
  }

  /** Show the camera's picture instead. */
  showVideo() {
    this.canvas.hidden = true;
    this.video.hidden = false;
    this.#hide();
    this.#fit(this.video.videoWidth, this.video.videoHeight);
    this.stage.isLive = true;
  }

  /** Hide the object until it is drawn in the present light. */
  #hide() {
    this.overlay.style.visibility = "hidden";
    this.lit = null;
  }

  #fit(width, height) {
    this.frame.style.aspectRatio = `${width} / ${height}`;
    this.frame.style.width = `min(100%, calc(var(--tallest) * ${width / height}))`;
  }

  /** @param {number | null} lensDeg field of view of the longer side, null where it is unknown */
  place(width, height, lensDeg, mask, box, ground = null) {
    this.stage.setPhoto(width, height, lensDeg, mask, box, ground);
    this.#showPitch();
  }

  /** Change the slope of the ground alone; the light stays. */
  setPitch(degrees) {
    this.stage.setPitch(degrees);
    this.#showPitch();
    this.render();
  }

  #showPitch() {
    element("pitch").value = this.stage.pitchDeg;
    element("pitch-value").textContent = `${Math.round(this.stage.pitchDeg)}°`;
  }

  setLight(light) {
    this.stage.setLight(light);
    this.lit ??= {}; // one for each picture
    this.render();
  }

  /** Draw soon, once however often it is asked for, and not before the last drawing is shown. */
  render() {
    this.isDue = true;
    this.drawing ??= this.#draw();
  }

  async #draw() {
    try {
      while (this.isDue) {
        await new Promise(requestAnimationFrame);
        this.isDue = false;
        const { lit } = this;
        await this.stage.render();
        if (lit && lit === this.lit) this.overlay.style.visibility = "visible";
      }
    } finally {
      this.drawing = null;
    }
    const note = this.stage.placeNote();
    if (element("place-note").textContent !== note) element("place-note").textContent = note;
    this.overlay.dispatchEvent(new CustomEvent("drawn", { detail: this.stage.pose() })); // all that was asked for
  }

  /** Whether a place of the picture is on the virtual object, x and y as shares. */
  grab(at) {
    const { stage } = this;
    const [x, y] = this.#pixel(at);
    if (this.overlay.style.visibility === "hidden" || at[0] < this.cut || !stage.isOnObject(x, y)) return false;
    const [fx, fy] = stage.footPx();
    this.hold = [fx - x, fy - y];
    this.overlay.classList.add("held");
    return true;
  }

  /** Move it along. */
  drag(at) {
    const [x, y] = this.#pixel(at);
    this.stage.moveTo(x + this.hold[0], y + this.hold[1]);
    this.render();
  }

  drop(isStill) {
    this.overlay.classList.remove("held");
    if (isStill) setStatus("This is the virtual object: drag it. To mark the real one, click on the object in the photo.");
  }

  #pixel([x, y]) {
    return [x * this.stage.width, y * this.stage.height];
  }

  #listen() {
    const before = element("before");
    const wipe = element("wipe");
    const divide = () => {
      const share = Number(before.value) / 100;
      const isCut = share > 0 && share < 1;
      const place = `calc(${KNOB} / 2 + (100% - ${KNOB}) * ${share})`; // of the knob's middle
      this.cut = share; // nearly
      this.overlay.style.clipPath = share === 0 ? "" : `inset(0 0 0 ${isCut ? place : "100%"})`;
      wipe.style.left = place;
      wipe.hidden = !isCut;
    };
    before.addEventListener("input", divide);
    divide();
    new ResizeObserver(() => this.render()).observe(this.overlay);
  }
}
