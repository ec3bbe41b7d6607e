/** The virtual object is hidden until it is drawn in a light of the picture that is shown. */

import assert from "node:assert/strict";
import { test } from "node:test";

import { Marking } from "../page/view/marking.js";
import { PhotoStage } from "../page/view/photoStage.js";
import { describeDirection } from "../page/view/pictures.js";

const elements = new Map();
const makeElement = () =>
  Object.assign(new EventTarget(), {
    style: {},
    classList: { add: () => {}, remove: () => {}, toggle: () => {} },
    getAttribute: () => "false",
    replaceChildren: (...parts) => (elements.get("said").value = parts.map((part) => part.textContent ?? part).join("")),
    value: "0",
    getContext: (kind) => (kind === "2d" ? { putImageData: () => {}, createImageData: () => ({}) } : null),
  });
globalThis.document = {
  createElement: makeElement,
  getElementById: (id) => {
    if (!elements.has(id)) elements.set(id, makeElement());
    return elements.get(id);
  },
};
globalThis.ResizeObserver = class {
  observe() {}
};
globalThis.requestAnimationFrame = (call) => setTimeout(call);
globalThis.ImageData = class {};

const settle = () => new Promise((resolve) => setTimeout(resolve, 20));
const picture = { width: 1, height: 1, rgba: new Uint8ClampedArray(4) };

/** A page's stage whose drawings are done when they are told to be. */
function open() {
  const shown = new PhotoStage();
  const drawings = [];
  shown.stage = { setLight: () => {}, placeNote: () => "", pose: () => null, render: () => new Promise((done) => drawings.push(done)) };
  return { shown, drawings, isSeen: () => shown.overlay.style.visibility !== "hidden" };
}

test("the last photo's object is not seen over the next photo", async () => {
  const { shown, drawings, isSeen } = open();
  shown.showPicture(picture);
  shown.setLight({});
  await settle();
  assert.ok(!isSeen() && drawings.length === 1);
  shown.showPicture(picture); // while the first is being drawn
  shown.setLight({});
  drawings[0]();
  await settle();
  assert.ok(!isSeen() && drawings.length === 2, "what was drawn is the last photo's");
  drawings[1]();
  await settle();
  assert.ok(isSeen());
  shown.showPicture(picture);
  assert.ok(!isSeen());
});

test("a press on the virtual object marks nothing, and says what to click unless it drags", () => {
  const { shown } = open();
  Object.assign(shown.stage, { width: 100, height: 100, isOnObject: (x) => x > 50, footPx: () => [60, 60], moveTo: () => {} });
  shown.overlay.style.visibility = "visible";
  const [canvas, band, button] = [makeElement(), makeElement(), makeElement()];
  Object.assign(canvas, { parentElement: canvas, setPointerCapture: () => {}, getBoundingClientRect: () => ({ left: 0, top: 0, width: 100, height: 100 }) });
  Object.assign(canvas, { getContext: () => new Proxy({}, { get: () => () => {} }) });
  const marked = [];
  const marking = new Marking({ canvas, band, button, removing: {}, cursor: {} }, shown, ({ click }) => marked.push(click.at(-1)));
  Object.assign(marking, { size: { width: 100, height: 100 } });
  const press = (x, end = x) => {
    elements.get("said").value = "";
    for (const [kind, clientX] of [["pointerdown", x], ["pointermove", end], ["pointerup", end], ["click", end]]) {
      canvas.dispatchEvent(Object.assign(new Event(kind), { clientX, clientY: 50, isPrimary: true, button: 0 }));
    }
    return elements.get("said").value;
  };
  elements.set("said", {});
  assert.match(press(60), /virtual object.*click on the object in the photo/);
  assert.match(press(60, 61), /virtual object/, "a hand trembles");
  assert.equal(press(60, 80), "");
  assert.deepEqual(marked, []);
  assert.equal(press(40), "");
  assert.deepEqual(marked, [[40, 50]]);
});

test("a direction in words", () => {
  assert.equal(describeDirection([-0.6, 0, 0.8]), "143° left, 0° up");
  assert.equal(describeDirection([0.1, 0.99, 0.1]), "82° up");
  for (const x of [0.01, -0.01, 0.25]) assert.match(describeDirection([x, 0, 0.968]), /^behind, /);
  assert.equal(describeDirection([0, -1, 0]), "90° down");
});

test("a direction is told above the horizon where the ground is known, as in anyprobe.estimate.ground", () => {
  const light = [0.5, 0.6, -Math.sqrt(1 - 0.61)];
  assert.equal(describeDirection(light), "39° right, 37° up");
  assert.equal(describeDirection(light, { pitchDeg: 22, rollDeg: -8 }), "37° right, 15° up");
});
