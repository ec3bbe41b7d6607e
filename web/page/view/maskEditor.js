/** The photo with the object's mask on it; clicks add to the object or take away, a box goes around it. */

import { BoxTool } from "./boxTool.js";
import { putRgba } from "./pictures.js";

const LONG_PX = 480;
const STEP = 0.02;
/** What is seen through a picture's transparent parts. */
const PAPER = 236;
const OUTLINE = [255, 196, 0];
/** A pixel is on the outline where one of these beside it is not inside. */
const EDGE = [[1, 0], [-1, 0], [0, 1], [0, -1], [2, 0], [-2, 0], [0, 2], [0, -2]];

/** Nothing is marked. @type {import("../../src/photo/picture.js").Hints} */
export const NO_HINTS = Object.freeze({ on: [], off: [], box: null });

export class MaskEditor {
  /**
   * @param {{canvas: HTMLCanvasElement, cursor: HTMLElement, removing: HTMLInputElement, band: HTMLElement,
   *   button: HTMLButtonElement}} parts band and button are the box's
   * @param {(hints: import("../../src/photo/picture.js").Hints) => void} onHints in pixels of the picture
   */
  constructor({ canvas, cursor, removing, band, button }, onHints) {
    Object.assign(this, { canvas, cursor, removing, onHints });
    this.hints = NO_HINTS;
    this.at = [0.5, 0.5];
    this.boxTool = new BoxTool({ canvas, band, button }, (box) => this.#enclose(box));
    canvas.addEventListener("click", (event) => {
      if (this.boxTool.takeClick()) return;
      const box = canvas.getBoundingClientRect();
      this.at = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      this.#click(event.shiftKey || removing.checked);
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Show a picture and forget what was marked on the last one. */
  open(picture) {
    this.picture = picture;
    this.reset();
    this.show(null);
  }

  /** Forget clicks and box; what is left of them. */
  reset() {
    this.boxTool.close();
    this.hints = NO_HINTS;
    return this.hints;
  }

  /** Show another picture of the same scene with its mask and the clicks and box that it was found by. */
  showOn(picture, mask, hints) {
    this.picture = picture;
    this.show(mask, hints);
  }

  /**
   * Show a mask on the picture: the rest dimmed, the outline bright, the clicks as dots, the box dashed.
   *
   * @param {Float32Array | null} mask
   * @param {import("../../src/photo/picture.js").Hints} [hints] by which it was found: what was marked since is forgotten
   */
  show(mask, hints = this.hints) {
    this.hints = hints;
    const { width, height, rgba } = this.picture;
    const scale = Math.min(1, LONG_PX / Math.max(width, height));
    const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
    const pixels = new Int32Array(w * h); // of the picture
    const inside = new Uint8Array(w * h);
    for (let y = 0, at = 0; y < h; y++) {
      const row = Math.floor((y + 0.5) / scale) * width;
      for (let x = 0; x < w; x++, at++) {
        pixels[at] = row + Math.floor((x + 0.5) / scale);
        inside[at] = mask !== null && mask[pixels[at]] > 0.5 ? 1 : 0;
      }
    }
    const isEdge = (x, y) => EDGE.some(([dx, dy]) => !inside[clamp(y + dy, h) * w + clamp(x + dx, w)]);
    const out = new Uint8ClampedArray(4 * w * h);
    for (let at = 0, to = 0; at < pixels.length; at++, to += 4) {
      const from = 4 * pixels[at];
      const alpha = rgba[from + 3] / 255;
      const dim = mask === null || inside[at] ? 1 : 0.45;
      const [gain, paper] = [dim * alpha, dim * PAPER * (1 - alpha)];
      out[to] = gain * rgba[from] + paper;
      out[to + 1] = gain * rgba[from + 1] + paper;
      out[to + 2] = gain * rgba[from + 2] + paper;
      out[to + 3] = 255;
    }
    for (let y = 0, at = 0; y < h; y++) {
      for (let x = 0; x < w; x++, at++) if (inside[at] && isEdge(x, y)) out.set(OUTLINE, 4 * at);
    }
    putRgba(this.canvas, out, w, h);
    this.#drawHints(scale);
  }

  #drawHints(scale) {
    const context = this.canvas.getContext("2d");
    if (this.hints.box) {
      const [x0, y0, x1, y1] = this.hints.box.map((value) => value * scale);
      context.lineWidth = 2;
      for (const [color, dash] of [["#000", []], ["#fff", [6, 6]]]) {
        context.strokeStyle = color;
        context.setLineDash(dash);
        context.strokeRect(x0, y0, x1 - x0, y1 - y0);
      }
      context.setLineDash([]);
    }
    for (const [points, color] of [[this.hints.on, "#0a7d33"], [this.hints.off, "#b3261e"]]) {
      for (const [x, y] of points) {
        context.beginPath();
        context.arc(x * scale, y * scale, 6, 0, 2 * Math.PI);
        context.fillStyle = color;
        context.fill();
        context.lineWidth = 2;
        context.strokeStyle = "#fff";
        context.stroke();
      }
    }
  }

  #click(removes) {
    if (!this.picture) return;
    const point = [this.at[0] * this.picture.width, this.at[1] * this.picture.height];
    const kind = removes ? "off" : "on";
    this.hints = { ...this.hints, [kind]: [...this.hints[kind], point] };
    this.onHints(this.hints);
  }

  /** A box takes the last one's place; clicks go on to count. */
  #enclose([x0, y0, x1, y1]) {
    if (!this.picture) return;
    const { width, height } = this.picture;
    this.hints = { ...this.hints, box: [x0 * width, y0 * height, x1 * width, y1 * height] };
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

const clamp = (value, length) => Math.min(Math.max(value, 0), length - 1);
