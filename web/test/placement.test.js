/** The virtual object stands beside the real one and all of it in the photo, wherever the real one is. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { BoxGeometry, Group, Matrix4, Mesh, PerspectiveCamera, SphereGeometry } from "three";

import { CONTRACT } from "../src/core/contract.js";
import { extentOf, outlineOf } from "../page/view/outline.js";
import { findSpot } from "../page/view/placement.js";
import { contactOf, likelyPitchDeg } from "../src/photo/ground.js";

const [WIDTH, HEIGHT] = [600, 400];

/** A flat thing so wide and high that stands on its foot; further up in the photo it is smaller. */
const card = (wide, high) => ({ x, y, share }) => {
  const scale = share * Math.max(0.5 + (0.5 * y) / HEIGHT, 0.1);
  return [x - (wide * scale) / 2, y - high * scale, x + (wide * scale) / 2, y + 0.1 * high * scale];
};

/** The photo of an object of rectangles. */
function photo(box, behind = box[3] - 60, rectangles = [box]) {
  const mask = new Float32Array(WIDTH * HEIGHT);
  for (const [x0, y0, x1, y1] of rectangles) for (let y = y0; y < y1; y++) mask.fill(1, y * WIDTH + x0, y * WIDTH + x1);
  return { mask, width: WIDTH, box, row: box[3], behind };
}

const isInside = ([x0, y0, x1, y1]) => x0 >= 0 && y0 >= 0 && x1 <= WIDTH && y1 <= HEIGHT;

test("nothing is cut off by the border, and what can stands beside on its row or nearer", () => {
  for (const box of [[10, 20, 150, 180], [200, 100, 400, 300], [480, 300, 599, 399], [0, 200, 330, 400]]) {
    for (const [wide, high] of [[100, 100], [700, 120], [60, 700], [20, 30]]) {
      const extentAt = card(wide, high);
      const spot = findSpot(photo(box), extentAt);
      const covered = extentAt(spot);
      assert.ok(isInside(covered), `${box} ${wide} ${high}: ${covered}`);
      assert.ok(covered[0] >= box[2] || covered[2] <= box[0] || covered[1] >= box[3] - 1, `${box} ${wide} ${high}: ${covered}`);
      assert.ok(covered[3] > Math.min(box[3], HEIGHT - 12) - 2, `${box} ${wide} ${high}: ${covered}`);
      assert.ok(!spot.isBehind && spot.share >= 0.2);
    }
  }
});

test("it is as large as asked where there is room, on the roomier side, and on the other where only that holds it", () => {
  const right = findSpot(photo([100, 100, 250, 300]), card(120, 120));
  assert.equal(right.share, 1);
  assert.ok(right.x > 250);
  assert.ok(Math.abs(card(120, 120)(right)[3] - 300) < 1);
  const left = findSpot(photo([350, 100, 500, 300]), card(120, 120));
  assert.ok(left.share === 1 && left.x < 350);
  // things beyond its left are drawn so large that only the right holds them
  const uneven = (spot) => card(spot.x < 300 ? 900 : 60, 60)(spot);
  const other = findSpot(photo([310, 100, 480, 300]), uneven);
  assert.ok(other.x > 480 && other.share === 1);
});

test("it stands below what overhangs, and in front of what is as wide as the photo", () => {
  const mushroom = photo([150, 40, 450, 300], 250, [[150, 40, 450, 120], [270, 120, 330, 300]]);
  const spot = findSpot(mushroom, card(80, 80));
  const [left, top] = card(80, 80)(spot);
  assert.ok(spot.share === 1 && left > 330 && left < 360 && top > 120, `${left} ${top}`);
  const front = findSpot(photo([0, 30, 600, 200]), card(80, 80));
  assert.ok(!front.isBehind && card(80, 80)(front)[1] >= 199);
});

test("without room beside it stands behind, inside the photo's border", () => {
  const spot = findSpot(photo([5, 5, 595, 395], 300), card(80, 80));
  assert.ok(spot.isBehind);
  const [x0, , x1, y1] = card(80, 80)(spot);
  assert.ok(x0 >= 0 && x1 <= WIDTH && Math.abs(y1 - 300) < 2, `${x0} ${x1} ${y1}`);
});

test("a sphere's outline covers what its silhouette does, of few points or many", () => {
  const camera = new PerspectiveCamera(40, WIDTH / HEIGHT);
  const away = 5;
  const clip = new Matrix4().multiplyMatrices(camera.projectionMatrix, new Matrix4().makeTranslation(0, 0, -away));
  const radius = 0.5;
  const tangent = radius / Math.sqrt(away ** 2 - radius ** 2);
  const px = (tangent / Math.tan((20 * Math.PI) / 180)) * (HEIGHT / 2);
  for (const [across, down] of [[40, 20], [256, 128]]) {
    const sphere = new Group().add(new Mesh(new SphereGeometry(radius, across, down)));
    const [x0, y0, x1, y1] = extentOf(outlineOf(sphere), clip, WIDTH, HEIGHT);
    for (const [found, expected] of [[x0, 300 - px], [x1, 300 + px], [y0, 200 - px], [y1, 200 + px]]) {
      assert.ok(Math.abs(found - expected) < 0.02 * px, `${found} ${expected}`);
    }
  }
});

test("parts are taken where they stand in their group, and what reaches behind the camera is too large", () => {
  const mesh = new Mesh(new BoxGeometry(1, 1, 1));
  mesh.position.set(2, 0, 0);
  const group = new Group().add(mesh);
  group.position.set(0, 7, 0);
  const outline = outlineOf(group);
  const xs = outline.filter((_, i) => i % 3 === 0);
  const ys = outline.filter((_, i) => i % 3 === 1);
  assert.deepEqual([Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)], [1.5, 2.5, -0.5, 0.5]);
  const camera = new PerspectiveCamera(40, 1);
  assert.ok(!isInside(extentOf(outline, camera.projectionMatrix, WIDTH, HEIGHT)));
});

test("an object touches the ground at its lower border, not below its box's middle, and specks are none of it", () => {
  const mask = new Float32Array(WIDTH * HEIGHT);
  const fill = (x0, y0, x1, y1) => {
    for (let y = y0; y < y1; y++) mask.fill(1, y * WIDTH + x0, y * WIDTH + x1);
  };
  fill(100, 50, 300, 200); // a head that leans over
  fill(100, 200, 160, 300); // its foot
  fill(220, 330, 222, 332);
  const [x, y] = contactOf(mask, WIDTH, [100, 50, 300, 332]);
  assert.deepEqual([x, y], [130, 300]);
});

test("an unknown camera looks down as usual, and further where the ground would be seen edge-on", () => {
  const [focal, { usual_pitch_deg: usual, least_slope_deg: least }] = [600, CONTRACT.ground];
  assert.equal(likelyPitchDeg(HEIGHT, HEIGHT, focal), usual);
  const above = HEIGHT / 2 - focal * Math.tan((20 * Math.PI) / 180); // a base 20 degrees above the middle
  assert.ok(Math.abs(likelyPitchDeg(above, HEIGHT, focal) - (least + 20)) < 1e-9);
});
