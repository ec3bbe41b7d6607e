/** The sphere nearest to an outline, as anyprobe.estimate.normals_hint.sphere_of_outline. */

import { focalPx } from "./lens.js";

/** Unit rays through the middles of a picture's pixels, camera frame, three numbers each. */
export function raysOf(width, height, longFovDeg) {
  const focal = focalPx(width, height, longFovDeg);
  const rays = new Float64Array(3 * width * height);
  for (let y = 0, at = 0; y < height; y++) {
    for (let x = 0; x < width; x++, at += 3) {
      const [right, up] = [(x + 0.5 - width / 2) / focal, (height / 2 - y - 0.5) / focal];
      const length = Math.sqrt(right * right + up * up + 1);
      rays[at] = right / length;
      rays[at + 1] = up / length;
      rays[at + 2] = -1 / length;
    }
  }
  return rays;
}

/**
 * A pinhole sees a sphere of angular radius phi around the axis c in all rays d with d.c >= cos phi. The outline's solid
 * angle 2 pi (1 - cos phi) gives phi, its mean ray c.
 *
 * @param {Float32Array} mask width * height in [0, 1]
 * @returns {{normals: Float32Array, overlap: number}} normals [height, width, 3] in the camera's frame, unit, zero beside the
 *   sphere; overlap: of the mask and the sphere, intersection over union
 */
export function sphereOfOutline(mask, width, longFovDeg) {
  const rays = raysOf(width, mask.length / width, longFovDeg);
  const focal = focalPx(width, mask.length / width, longFovDeg);
  const sums = [0, 0, 0];
  let solidAngle = 0;
  for (let i = 0; i < mask.length; i++) {
    if (mask[i] === 0) continue;
    const angle = (mask[i] * -(rays[3 * i + 2] ** 3)) / focal ** 2; // what the mask covers of the pixel [sr]
    solidAngle += angle;
    for (let axis = 0; axis < 3; axis++) sums[axis] += angle * rays[3 * i + axis];
  }
  const [x, y, z] = sums.map((sum) => sum / Math.hypot(...sums));
  const cosine = 1 - solidAngle / (2 * Math.PI);
  const radius = Math.sqrt(Math.max(1 - cosine ** 2, 1e-12));
  const normals = new Float32Array(rays.length);
  let [shared, covered] = [0, 0];
  for (let i = 0, at = 0; i < mask.length; i++, at += 3) {
    const along = rays[at] * x + rays[at + 1] * y + rays[at + 2] * z;
    const [inside, on] = [along > cosine, mask[i] > 0.5];
    if (inside && on) shared++;
    if (inside || on) covered++;
    if (!inside) continue;
    const distance = along - Math.sqrt(Math.max(radius ** 2 - 1 + along ** 2, 0));
    normals[at] = (distance * rays[at] - x) / radius;
    normals[at + 1] = (distance * rays[at + 1] - y) / radius;
    normals[at + 2] = (distance * rays[at + 2] - z) / radius;
  }
  return { normals, overlap: shared / covered };
}
