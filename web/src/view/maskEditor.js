/** The photo with the object's mask on it; clicks add to the object or take away. */

import { putRgba } from "./pictures.js";

const LONG_PX = 480;
const STEP = 0.02;

export class MaskEditor {
  /**
   * @param {{canvas: HTMLCanvasElement, cursor: HTMLElement, removing: HTMLInputElement}} parts
   * @param {(clicks: {on: number[][], off: number[][]}) => void} onClicks x, y in pixels of the picture
   */
  constructor({ canvas, cursor, removing }, onClicks) {
    Object.assign(this, { canvas, cursor, removing, onClicks });
    this.clicks = { on: [], off: [] };
    this.at = [0.5, 0.5];
    canvas.addEventListener("click", (event) => {
      const box = canvas.getBoundingClientRect();
      this.at = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      this.#click(event.shiftKey || removing.checked);
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Show a picture and forget the clicks on the last one. */
  open(picture) {
    this.picture = picture;
    this.clicks = { on: [], off: [] };
    this.show(null);
  }

  /** Forget the clicks; what is left of them. */
  reset() {
    this.clicks = { on: [], off: [] };
    return this.clicks;
  }

  /** Show another picture of the same scene with its mask; the clicks stay. */
  showOn(picture, mask) {
    this.picture = picture;
    this.show(mask);
  }

  /** Show a mask on the picture: the rest dimmed, the outline bright, the clicks as dots. */
  show(mask) {
    const { width, height, rgba } = this.picture;
    const scale = Math.min(1, LONG_PX / Math.max(width, height));
    const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
    const from = (x, y) => Math.floor((y + 0.5) / scale) * width + Math.floor((x + 0.5) / scale);
    const inside = (x, y) => mask !== null && mask[from(x, y)] > 0.5;
    const out = new Uint8ClampedArray(4 * w * h);
    for (let y = 0; y < h; y++) {
      for (let x = 0; x < w; x++) {
        const pixel = from(x, y);
        const alpha = rgba[4 * pixel + 3] / 255;
        const dim = mask === null || inside(x, y) ? 1 : 0.45;
        const edge =
          inside(x, y) &&
          [[1, 0], [-1, 0], [0, 1], [0, -1], [2, 0], [-2, 0], [0, 2], [0, -2]].some(
            ([dx, dy]) => !inside(clamp(x + dx, w), clamp(y + dy, h)),
          );
        for (let c = 0; c < 3; c++) {
          const shown = rgba[4 * pixel + c] * alpha + 236 * (1 - alpha);
          out[4 * (y * w + x) + c] = edge ? [255, 196, 0][c] : shown * dim;
        }
        out[4 * (y * w + x) + 3] = 255;
      }
    }
    putRgba(this.canvas, out, w, h);
    this.#drawClicks(scale);
  }

  #drawClicks(scale) {
    const context = this.canvas.getContext("2d");
    for (const [points, color] of [[this.clicks.on, "#0a7d33"], [this.clicks.off, "#b3261e"]]) {
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
    (removes ? this.clicks.off : this.clicks.on).push(point);
    this.onClicks(this.clicks);
  }

  /** Arrows move a cross, Enter adds, Delete takes away. */
  #key(event) {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (event.key in moves) {
      this.at = this.at.map((value, i) => Math.min(Math.max(value + STEP * moves[event.key][i], 0), 1));
      this.cursor.style.left = `${100 * this.at[0]}%`;
      this.cursor.style.top = `${100 * this.at[1]}%`;
    } else if (event.key === "Enter" || event.key === " ") this.#click(this.removing.checked);
    else if (event.key === "Delete" || event.key === "Backspace") this.#click(true);
    else return;
    event.preventDefault();
  }
}

const clamp = (value, length) => Math.min(Math.max(value, 0), length - 1);
