/** The photo or the camera's picture, the virtual object over it, and the line between before and after. */

import { Stage } from "./stage.js";
import { element } from "./elements.js";
import { putRgba } from "./pictures.js";

/** What is seen through a photo's transparent parts. */
const PAPER = [231, 229, 225];

export class PhotoStage {
  constructor() {
    this.canvas = element("photo");
    this.video = element("video");
    this.overlay = element("overlay");
    this.frame = element("frame");
    this.stage = new Stage(this.overlay);
    for (const part of [this.overlay, element("divide")]) part.hidden = !this.stage.canDraw;
    this.#listen();
  }

  showPicture({ width, height, rgba }) {
    this.video.hidden = true;
    this.canvas.hidden = false;
    const opaque = rgba.slice();
    for (let i = 0; i < opaque.length; i += 4) {
      const alpha = rgba[i + 3] / 255;
      for (let c = 0; c < 3; c++) opaque[i + c] = rgba[i + c] * alpha + PAPER[c] * (1 - alpha);
      opaque[i + 3] = 255;
    }
    putRgba(this.canvas, opaque, width, height);
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

  /** Until the object is drawn in a light of what is shown now. */
  #hide() {
    this.overlay.style.visibility = "hidden";
    this.lit = null;
  }

  #fit(width, height) {
    this.frame.style.aspectRatio = `${width} / ${height}`;
    const fitted = `min(100%, calc(var(--tallest) * ${width / height}))`;
    this.frame.style.width = fitted;
    element("divide").style.width = fitted; // its knob stands below the line
  }

  /** @param {number | null} lensDeg field of view of the longer side, null where it is unknown */
  place(width, height, lensDeg, mask, box, ground = null) {
    this.stage.setPhoto(width, height, lensDeg, mask, box, ground);
    this.#showPitch();
  }

  /** The slope of the ground alone; the light stays. */
  setPitch(degrees) {
    this.stage.setPitch(degrees);
    this.#showPitch();
    this.render();
  }

  #showPitch() {
    element("pitch").value = this.stage.pitchDeg;
    element("pitch-value").textContent = `${Math.round(this.stage.pitchDeg)}°`;
  }

  setLight(light, reflections = null) {
    this.stage.setLight(light, reflections);
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

  #listen() {
    const before = element("before");
    const wipe = element("wipe");
    const divide = () => {
      this.overlay.style.clipPath = before.value === "0" ? "" : `inset(0 0 0 ${before.value}%)`;
      wipe.style.left = `${before.value}%`;
      wipe.hidden = before.value === "0" || before.value === "100";
    };
    before.addEventListener("input", divide);
    divide();
    new ResizeObserver(() => this.render()).observe(this.overlay);

    const { overlay, stage } = this;
    let held = null;
    const place = (event) => {
      const box = overlay.getBoundingClientRect();
      return [
        ((event.clientX - box.left) / box.width) * stage.width,
        ((event.clientY - box.top) / box.height) * stage.height,
      ];
    };
    overlay.addEventListener("pointerdown", (event) => {
      const [x, y] = place(event);
      if (!stage.isOnObject(x, y)) return;
      const [fx, fy] = stage.footPx();
      held = [fx - x, fy - y];
      overlay.setPointerCapture(event.pointerId);
    });
    overlay.addEventListener("pointermove", (event) => {
      if (!held) return;
      const [x, y] = place(event);
      stage.moveTo(x + held[0], y + held[1]);
      this.render();
    });
    for (const end of ["pointerup", "pointercancel"]) overlay.addEventListener(end, () => (held = null));
  }
}
