/** The object's outline on the photo, and the clicks and the box by which it is corrected. */

import { BoxTool, LEAST_PX } from "./boxTool.js";

/** Longer side of the outline's canvas, pixels: of a photo, and of the camera's picture, which is drawn many times a second. */
const [PHOTO_PX, VIDEO_PX] = [960, 480];
/** Of the picture's width and height for each arrow key. */
const STEP = 0.02;
/** Colours as 0xAABBGGRR: amber, and translucent black. */
const [OUTLINE, HALO] = [0xff00c4ff, 0x96000000];
/** Neighbours that decide whether a pixel inside is on the outline, or one outside on its halo. */
const EDGE = [[1, 0], [-1, 0], [0, 1], [0, -1], [2, 0], [-2, 0], [0, 2], [0, -2]];
const REACH = 2;
const DOT_PX = 7;

/** Nothing is marked. @type {{click: number[][], exclude: number[][], box: number[] | null}} */
export const NO_HINTS = Object.freeze({ click: [], exclude: [], box: null });

export class Marking {
  /**
   * @param {{canvas: HTMLCanvasElement, cursor: HTMLElement, removing: HTMLInputElement, band: HTMLElement,
   *   button: HTMLButtonElement}} parts band and button are the box's
   * @param {{grab(at: number[]): boolean, drag(at: number[]): void, drop(isStill: boolean): void}} held what a press takes before it
   *   marks: the virtual object, which is still if it was not dragged; x and y as shares of the picture
   * @param {(hints: import("../../types/index.d.ts").Hints) => void} onHints in pixels of the picture
   */
  constructor({ canvas, cursor, removing, band, button }, held, onHints) {
    Object.assign(this, { canvas, cursor, removing, held, onHints });
    this.size = null;
    this.hints = NO_HINTS;
    this.at = [0.5, 0.5];
    this.boxTool = new BoxTool({ canvas, band, button }, (box) => this.#enclose(box));
    this.#listen();
  }

  /** Begin with another picture: nothing is found or marked on it. @param {{width: number, height: number}} picture */
  open({ width, height }) {
    this.glide(0, 0);
    this.size = { width, height };
    this.reset();
    this.show(null);
  }

  /** Forget clicks and box; return what is left. */
  reset() {
    this.boxTool.close();
    return (this.hints = NO_HINTS);
  }

  /**
   * Show a mask's outline, the clicks as dots and the box dashed.
   *
   * @param {{data: Float32Array, width: number, height: number} | null} mask of the picture's aspect
   * @param {import("../../types/index.d.ts").Hints} [hints] by which it was found: what was marked since is forgotten
   */
  show(mask, hints = this.hints) {
    this.hints = hints;
    this.#draw(mask, PHOTO_PX);
    this.#drawHints();
  }

  /** Move what is drawn, by shares of the picture. */
  glide(across, down) {
    this.canvas.style.translate = `${100 * across}% ${100 * down}%`;
  }

  /** Show the outline of a moving picture's mask alone: where it was marked, other things are by now. */
  follow(mask, hints) {
    this.hints = hints;
    this.#draw(mask, VIDEO_PX);
  }

  #listen() {
    const { canvas, boxTool, held } = this;
    let [isHeld, wasHeld, start] = [false, false, null]; // the click that a drag ends with is still to come
    const isNear = ({ clientX, clientY }) => Math.hypot(clientX - start.clientX, clientY - start.clientY) < LEAST_PX;
    canvas.addEventListener("pointerdown", (event) => {
      start = event;
      wasHeld = isHeld = event.isPrimary && event.button === 0 && !boxTool.isOn && held.grab(this.#placeOf(event));
      if (isHeld) canvas.setPointerCapture(event.pointerId);
      else boxTool.press(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (isHeld) held.drag(this.#placeOf(event));
      else boxTool.move(event);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        if (isHeld) held.drop(end === "pointerup" && isNear(event));
        else if (end === "pointerup") boxTool.release(event);
        else boxTool.drop();
        isHeld = false;
      });
    }
    // a finger scrolls the page unless it moves the object
    canvas.addEventListener("touchstart", (event) => isHeld && event.preventDefault(), { passive: false });
    canvas.addEventListener("click", (event) => {
      if (boxTool.takeClick() || wasHeld) return;
      this.at = this.#placeOf(event);
      this.#click(event.shiftKey || this.removing.checked);
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  #placeOf({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.parentElement.getBoundingClientRect(); // which does not glide
    return [(clientX - left) / width, (clientY - top) / height];
  }

  #draw(mask, longPx) {
    const { width, height } = mask ?? this.size;
    const scale = Math.min(1, longPx / Math.max(width, height));
    const [w, h] = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
    Object.assign(this.canvas, { width: w, height: h });
    if (!mask) return;
    const context = this.canvas.getContext("2d");
    const drawn = context.createImageData(w, h);
    drawOutline(drawn, insideOf(mask, w, h));
    context.putImageData(drawn, 0, 0);
  }

  #drawHints() {
    const { canvas, hints, size } = this;
    const context = canvas.getContext("2d");
    const [across, down] = [canvas.width / size.width, canvas.height / size.height];
    const unit = canvas.width / (canvas.clientWidth || canvas.width); // of the screen
    if (hints.box) {
      const [x0, y0, x1, y1] = hints.box;
      context.lineWidth = 2 * unit;
      for (const [color, dash] of [["#000", []], ["#fff", [6 * unit, 6 * unit]]]) {
        context.strokeStyle = color;
        context.setLineDash(dash);
        context.strokeRect(x0 * across, y0 * down, (x1 - x0) * across, (y1 - y0) * down);
      }
      context.setLineDash([]);
    }
    for (const [points, color] of [[hints.click, "#0a7d33"], [hints.exclude, "#b3261e"]]) {
      for (const [x, y] of points) {
        context.beginPath();
        context.arc(x * across, y * down, DOT_PX * unit, 0, 2 * Math.PI);
        context.fillStyle = color;
        context.fill();
        context.lineWidth = 2 * unit;
        context.strokeStyle = "#fff";
        context.stroke();
      }
    }
  }

  #click(removes) {
    if (!this.size) return;
    const point = [this.at[0] * this.size.width, this.at[1] * this.size.height];
    const kind = removes ? "exclude" : "click";
    this.hints = { ...this.hints, [kind]: [...this.hints[kind], point] };
    this.#drawHints();
    this.onHints(this.hints);
  }

  /** A box replaces the last one; clicks are kept. */
  #enclose([x0, y0, x1, y1]) {
    if (!this.size) return;
    const { width, height } = this.size;
    this.hints = { ...this.hints, box: [x0 * width, y0 * height, x1 * width, y1 * height] };
    this.#drawHints();
    this.onHints(this.hints);
  }

  /** Arrows move a cross, Enter adds, Delete takes away; while a box is drawn Enter marks its corners. */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return; // the browser's own
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (event.key in moves) {
      this.at = this.at.map((value, i) => Math.min(Math.max(value + STEP * moves[event.key][i], 0), 1));
      this.cursor.style.left = `${100 * this.at[0]}%`;
      this.cursor.style.top = `${100 * this.at[1]}%`;
      this.boxTool.stretch(this.at);
    } else if (event.key === "Enter" || event.key === " ") {
      if (!this.boxTool.isOn || !this.boxTool.mark(this.at)) this.#click(this.removing.checked);
    } else if (event.key === "Escape" && this.boxTool.isOn) this.boxTool.close();
    else if (event.key === "Delete" || event.key === "Backspace") this.#click(true);
    else return;
    event.preventDefault();
  }
}

/** Which pixels of a canvas of w by h are the mask's. @returns {Uint8Array} */
function insideOf({ data, width, height }, w, h) {
  const inside = new Uint8Array(w * h);
  for (let y = 0, at = 0; y < h; y++) {
    const row = Math.floor(((y + 0.5) * height) / h) * width;
    for (let x = 0; x < w; x++, at++) inside[at] = data[row + Math.floor(((x + 0.5) * width) / w)] > 0.5 ? 1 : 0;
  }
  return inside;
}

/** A bright line inside the mask's edge and a dark one outside, visible on any photo. */
function drawOutline({ data, width, height }, inside) {
  const pixels = new Uint32Array(data.buffer);
  const beside = EDGE.map(([dx, dy]) => dy * width + dx);
  for (let y = REACH; y < height - REACH; y++) {
    for (let at = y * width + REACH; at < (y + 1) * width - REACH; at++) {
      const own = inside[at];
      if (beside.some((step) => inside[at + step] !== own)) pixels[at] = own ? OUTLINE : HALO;
    }
  }
}
