/**
 * The photo with a virtual object on the ground beside the real one, lit by the estimate.
 *
 * The scene is the photo's camera frame: the camera sits at the origin and looks along -Z.
 */

import { DirectionalLight, Group, Matrix4, PCFShadowMap, Raycaster, Scene, Vector2, Vector3, WebGLRenderer } from "three";
import { DEFAULT_LONG_FOV_DEG } from "../../src/photo/lens.js";
import { showDrawn } from "./drawnAside.js";
import { ContactShadow, EnvironmentTexture, MaskOccluder, PhotoGround, installCameraCurve } from "../../src/three/index.js";
import { extentOf, outlineOf } from "./outline.js";
import { findSpot } from "./placement.js";
import { dispose } from "./virtualObjects.js";
import { findWebgl } from "./webgl.js";

/** Height of the object over the real one's, at size 1 and where there is room. */
const OF_REAL = 0.5;
/** Side of the shadow's map; software draws it too. */
const SHADOW_PX = 256;
/** Pixels drawn for a pixel shown, along each side, over the camera's picture where WebGL is software. */
const COARSE = 0.7;
/** Nothing is placed nearer to the horizon than this, of the photo's height. */
const BELOW_HORIZON = 0.02;

export class Stage {
  /**
   * Without WebGL everything has its place, and nothing is drawn.
   *
   * @param {HTMLCanvasElement} canvas lies over the photo and is clear but for object and shadow
   */
  constructor(canvas) {
    const { canDraw, isSoftware } = findWebgl();
    Object.assign(this, { canvas, canDraw, isSoftware });
    if (canDraw) this.#openRenderer();
    this.environment = new EnvironmentTexture();
    this.scene = new Scene();
    this.ground = this.object = null; // until there is a photo, and a choice
    this.turn = 0;
    this.size = 1;
    this.isLive = false;
    this.isTouched = false;
    this.standing = new Group(); // moves on the ground, carries object and contact shadow
    this.contactShadow = new ContactShadow();
    this.contactShadow.position.y = 0.002;
    this.standing.add(this.contactShadow);
    this.realObject = new MaskOccluder();
    // the environment lights the object, its dominant light included; this light only casts the shadow
    const directionalLight = new DirectionalLight(0xffffff, 0);
    this.lights = Object.assign(new Group().add(directionalLight, directionalLight.target), { directionalLight, estimate: null });
    this.scene.add(this.realObject.group, this.lights);
  }

  #openRenderer() {
    const { canvas, isSoftware } = this;
    this.renderer = new WebGLRenderer({
      canvas: isSoftware ? document.createElement("canvas") : canvas,
      alpha: true,
      antialias: !isSoftware,
    });
    installCameraCurve(this.renderer);
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
  }

  /**
   * Set the photo's camera and where the real object stands.
   *
   * @param {number} width of the photo in pixels
   * @param {number | null} lensDeg field of view of the longer side; null where it is unknown
   * @param {Float32Array} mask of the real object, width * height, or of a smaller picture's shape
   * @param {number[]} box of the real object, x0, y0, x1, y1 in pixels
   * @param {{pitchDeg: number} | null} [ground] that came with the light; null: guessed
   */
  setPhoto(width, height, lensDeg, mask, box, ground = null) {
    const longFovDeg = lensDeg ?? DEFAULT_LONG_FOV_DEG;
    const isSame = [width, height, ...box].join() === [this.width, this.height, ...(this.box ?? [])].join();
    Object.assign(this, { mask, width, height, longFovDeg, box });
    this.camera = PhotoGround.camera({ mask: { width, height }, lens: { longFovDeg } });
    this.isTouched = isSame && this.isTouched; // what was moved stays where it is
    this.setPitch(this.isTouched ? this.pitchDeg : ground?.pitchDeg);
    this.setMask(mask);
  }

  /** The real object hides what lies behind it: shadows on the ground, and the virtual object there. */
  setMask(mask) {
    this.realObject.show({ data: mask, width: this.width, height: this.height }, this.ground.distance, this.ground.focalPx);
  }

  /** Put the object beside the real one, all of it in the photo. */
  #standBeside() {
    const { mask, width, height, box, size, ground } = this;
    const { distance, focalPx, pitchDeg } = ground;
    const real = Math.max(box[3] - box[1], 0.6 * (box[2] - box[0]));
    const asked = (OF_REAL * real * distance) / focalPx;
    const farRow = height / 2 - focalPx * Math.tan((pitchDeg * Math.PI) / 180) + BELOW_HORIZON * height;
    const extentAt = ({ x, y, share }) => {
      this.#setFoot(x, Math.max(y, farRow));
      this.standing.scale.setScalar(asked * share * size);
      return this.#extent();
    };
    const depth = (((box[2] - box[0]) / focalPx) * distance + asked) / 2; // of the real object, as deep as wide, and room
    const [, row] = this.#pixelOf(ground.position.clone());
    const [, behind] = this.#pixelOf(ground.localToWorld(new Vector3(0, 0, -depth)));
    const { x, y, share, isBehind } = findSpot({ mask, width, box, row, behind }, extentAt);
    this.unit = asked * share;
    this.isBehind = isBehind;
    this.#setFoot(x, Math.max(y, farRow));
    this.#place();
  }

  /** What the object covers, x0, y0, x1, y1 in pixels. */
  #extent() {
    this.standing.updateWorldMatrix(true, false);
    const clip = new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.standing.matrixWorld);
    return extentOf(this.outline, clip, this.width, this.height);
  }

  /** The pixel that shows a place. */
  #pixelOf(place) {
    const { x, y } = place.project(this.camera);
    return [((x + 1) / 2) * this.width, ((1 - y) / 2) * this.height];
  }

  /** Whoever moved or scaled the object finds it where it was left; until then it stands beside the real one. */
  #stand() {
    if (this.box && this.object && !this.isTouched) this.#standBeside();
    else this.#place();
  }

  get pitchDeg() {
    return this.ground.pitchDeg;
  }

  /** Lay the ground. @param {number} [pitchDeg] how far the camera looks down, its slope in the picture; default: guessed */
  setPitch(pitchDeg) {
    const { mask: data, width, height, camera, scene, standing } = this;
    this.ground?.removeFromParent();
    this.ground?.dispose();
    this.ground = new PhotoGround({ mask: { data, width, height } }, camera, { pitchDeg });
    scene.add(this.ground.add(standing));
    this.#stand();
  }

  /** @param {Group} object one unit high, standing on its origin */
  setObject(object) {
    if (this.object) {
      this.standing.remove(this.object);
      dispose(this.object);
    }
    this.object = object;
    this.outline = outlineOf(object);
    this.standing.add(object);
    this.#stand();
  }

  /** Rotation about the ground's normal [degrees] and size, 1 for a good part of the real object's. */
  setPose({ turn = this.turn, size = this.size }) {
    if (size !== this.size) this.isTouched = true;
    Object.assign(this, { turn, size });
    this.standing.rotation.y = (turn * Math.PI) / 180;
    this.#stand();
  }

  #place() {
    if (!this.object) return;
    this.standing.scale.setScalar((this.unit ?? 1) * this.size);
    this.contactShadow.scale.setScalar(1.1 * this.object.userData.width);
    this.#castShadow();
  }

  /** Move the object to where the ground lies behind a pixel of the photo, if any does. */
  moveTo(x, y) {
    this.isTouched = true;
    this.isBehind = false;
    this.#setFoot(x, y);
    this.#castShadow();
  }

  #setFoot(x, y) {
    const place = this.ground.at([x, y]);
    if (place) this.standing.position.copy(place);
  }

  /** Where the object stands in the camera's frame, the ground's normal there, its unit's length, and the field of view. */
  pose() {
    const up = this.ground && new Vector3(0, 1, 0).applyQuaternion(this.ground.quaternion).toArray();
    const foot = this.standing.getWorldPosition(new Vector3()).toArray();
    return { foot, up, scale: this.standing.scale.x, longFovDeg: this.longFovDeg };
  }

  /** What is to be said of the object's place: empty where all of it is in the photo, and nothing hides it. */
  placeNote() {
    if (!this.object || !this.ground) return "";
    if (this.isBehind) return "There is no room beside the object: the virtual one stands behind it. Drag it.";
    const [x0, y0, x1, y1] = this.#extent();
    const isInside = x0 >= 0 && y0 >= 0 && x1 <= this.width && y1 <= this.height;
    return isInside ? "" : "Part of the virtual object is outside the photo.";
  }

  /** Pixel of the photo where the object stands. */
  footPx() {
    return this.#pixelOf(this.standing.getWorldPosition(new Vector3()));
  }

  /** Whether a pixel of the photo shows the object, or nearly. */
  isOnObject(x, y) {
    if (!this.object) return false;
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2((2 * x) / this.width - 1, 1 - (2 * y) / this.height), this.camera);
    const [fx, fy] = this.footPx();
    const reach = 0.04 * this.height; // a press beside it marks the photo
    return caster.intersectObject(this.object, true).length > 0 || Math.hypot(x - fx, y - fy) < reach;
  }

  /** @param {import("../../src/light/light.js").Light} light */
  setLight(light) {
    this.scene.environment = this.environment.update(light.prefiltered);
    this.lights.estimate = light;
    this.lights.directionalLight.position.set(...light.dominant.direction);
    this.#castShadow();
  }

  /** Let the dominant light cast the object's shadow, the softer the wider it is. */
  #castShadow() {
    const { estimate, directionalLight: { shadow } } = this.lights;
    if (!this.canDraw || !estimate || !this.ground || !this.object) return;
    this.ground.castFrom(this.lights);
    shadow.mapSize.set(SHADOW_PX, SHADOW_PX);
    shadow.radius = 2 + 6 * Math.min((estimate.dominant.radiusDeg * Math.PI) / 180, 1);
  }

  /**
   * Draw at the size the canvas is shown at, coarser where that keeps the camera's picture going.
   *
   * @returns {Promise<void>} until it is shown
   */
  async render() {
    const { renderer, canvas } = this;
    const sharp = Math.min(window.devicePixelRatio, 2);
    const ratio = this.isSoftware ? (this.isLive ? COARSE : 2 * sharp) : sharp; // software draws edges without half tones
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!this.canDraw || !width || !height || !this.ground) return;
    const size = renderer.getDrawingBufferSize(new Vector2());
    if (size.x !== Math.floor(width * ratio) || size.y !== Math.floor(height * ratio)) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
    }
    renderer.render(this.scene, this.camera);
    if (this.isSoftware) await showDrawn(renderer.getContext(), canvas);
  }
}
