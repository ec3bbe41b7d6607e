import { CanvasTexture } from "three";

/** A round spot, dark in its middle, for the darkness where an object touches the ground. */
export function softSpot() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 128;
  const context = canvas.getContext("2d");
  const shade = context.createRadialGradient(64, 64, 0, 64, 64, 64);
  for (const [place, alpha] of [[0, 1], [0.35, 0.75], [0.65, 0.25], [1, 0]]) {
    shade.addColorStop(place, `rgba(0, 0, 0, ${alpha})`);
  }
  context.fillStyle = shade;
  context.fillRect(0, 0, 128, 128);
  return new CanvasTexture(canvas);
}
