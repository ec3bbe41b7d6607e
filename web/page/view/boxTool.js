/** A box around the object: dragged with the mouse, with a finger once the tool is on, or two corners by key. */

/** A box narrower or lower than this on the screen counts as a click. */
export const LEAST_PX = 6;

export class BoxTool {
  /**
   * @param {{canvas: HTMLCanvasElement, band: HTMLElement, button: HTMLButtonElement}} parts band: shows the box
   *   while it is drawn
   * @param {(box: number[]) => void} onBox x0, y0, x1, y1 as shares of the canvas
   */
  constructor({ canvas, band, button }, onBox) {
    Object.assign(this, { canvas, band, button, onBox });
    this.corner = null;
    this.hasDrawn = false;
    button.addEventListener("click", () => {
      this.#turn(!this.isOn);
      if (this.isOn) canvas.focus({ preventScroll: true });
    });
  }

  /** Whether a finger draws, rather than scrolls the page, and Enter marks a corner. */
  get isOn() {
    return this.button.getAttribute("aria-pressed") === "true";
  }

  /** Mark a corner, x and y as shares; the second ends the box. Whether that was a box, or is going to be one. */
  mark(at) {
    if (this.corner) return this.#end(at);
    this.corner = at;
    this.stretch(at);
    return true;
  }

  /** Show the box from the first corner to a point. */
  stretch(at) {
    if (!this.corner) return;
    const [x0, y0, x1, y1] = between(this.corner, at).map((share) => `${100 * share}%`);
    Object.assign(this.band.style, { left: x0, top: y0, right: `calc(100% - ${x1})`, bottom: `calc(100% - ${y1})` });
    this.band.hidden = false;
  }

  /** Forget the first corner; return whether there was one. */
  drop() {
    const had = this.corner !== null;
    this.corner = this.pointer = null;
    this.band.hidden = true;
    return had;
  }

  /** Whether the click at the end of a drag is still to come; it is ignored. */
  takeClick() {
    const drawn = this.hasDrawn;
    this.hasDrawn = false;
    return drawn;
  }

  /** Put the tool away. */
  close() {
    this.#turn(false);
  }

  #turn(isOn) {
    this.button.setAttribute("aria-pressed", String(isOn));
    this.canvas.classList.toggle("boxing", isOn);
    this.drop();
  }

  /** A pointer goes down, perhaps at the first corner. */
  press(event) {
    this.hasDrawn = false;
    if (!event.isPrimary || event.button !== 0 || (event.pointerType === "touch" && !this.isOn)) return;
    this.corner = this.#at(event);
    this.pointer = event.pointerId;
    this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    if (this.pointer === event.pointerId) this.stretch(this.#at(event));
  }

  release(event) {
    if (this.pointer === event.pointerId) this.hasDrawn = this.#end(this.#at(event));
  }

  #end(at) {
    const box = between(this.corner, at);
    this.drop();
    const { width, height } = this.canvas.getBoundingClientRect();
    if ((box[2] - box[0]) * width < LEAST_PX || (box[3] - box[1]) * height < LEAST_PX) return false;
    this.close();
    this.onBox(box);
    return true;
  }

  #at({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return [(clientX - left) / width, (clientY - top) / height].map((share) => Math.min(Math.max(share, 0), 1));
  }
}

const between = ([ax, ay], [bx, by]) => [Math.min(ax, bx), Math.min(ay, by), Math.max(ax, bx), Math.max(ay, by)];
