/**
 * The photo with a virtual object on the ground beside the real one, lit by the estimate.
 *
 * The scene is the photo's camera frame: the camera sits at the origin and looks along -Z. The
 * ground is a plane under the real object, tilted by the camera pitch; only shadows are drawn on it.
 */

import {
  DirectionalLight,
  Group,
  Matrix4,
  Mesh,
  PCFShadowMap,
  PerspectiveCamera,
  Plane,
  PlaneGeometry,
  Quaternion,
  Raycaster,
  Scene,
  ShadowMaterial,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { DEFAULT_LONG_FOV_DEG, pixelDirection } from "../../src/photo/lens.js";
import { contactOf, likelyPitchDeg, seenPitchDeg } from "../../src/photo/ground.js";
import { showDrawn } from "./drawnAside.js";
import { ContactShadow, EnvironmentTexture, MaskOccluder, groundShadowOpacity, installCameraCurve } from "../../src/three/index.js";
import { extentOf, outlineOf } from "./outline.js";
import { findSpot } from "./placement.js";
import { dispose } from "./virtualObjects.js";
import { findWebgl } from "./webgl.js";

/** Distance of the real object's base, in units of the scene; only proportions are seen. */
const DISTANCE = 5;
const UP = new Vector3(0, 1, 0);
/** Height of the object over the real one's, at size 1 and where there is room. */
const OF_REAL = 0.5;
const SHADOW_PX = 256;
/** Side of the plane that catches the shadow, in reaches of the light that casts it. */
const CATCHER = 6;
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
    this.camera = new PerspectiveCamera();
    this.camera.near = 0.05;
    this.object = null;
    this.turn = 0;
    this.size = 1;
    this.isLive = false;
    this.isTouched = false;
    this.#buildGround();
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

  #buildGround() {
    this.ground = new Group();
    this.standing = new Group(); // moves on the ground, carries object and contact shadow
    this.catcher = new Mesh(new PlaneGeometry(1, 1).rotateX(-Math.PI / 2), new ShadowMaterial({ toneMapped: false }));
    this.catcher.receiveShadow = true;
    this.contactShadow = new ContactShadow();
    this.contactShadow.position.y = 0.002;
    this.standing.add(this.contactShadow);
    this.ground.add(this.catcher, this.standing);
    this.realObject = new MaskOccluder();
    this.scene.add(this.realObject.group);
    // the environment lights the object, its dominant light included; this light only casts the shadow
    this.shadowLight = new DirectionalLight(0xffffff, 0);
    this.shadowLight.castShadow = true;
    this.shadowLight.shadow.mapSize.set(SHADOW_PX, SHADOW_PX);
    this.shadowLight.shadow.bias = -0.0005;
    this.scene.add(this.ground, this.shadowLight, this.shadowLight.target);
  }

  /**
   * Set the photo's camera and where the real object stands.
   *
   * @param {number} width of the photo in pixels
   * @param {number} height
   * @param {number | null} lensDeg field of view of the longer side; null where it is unknown
   * @param {Float32Array} mask of the real object, width * height, or of a smaller picture's shape
   * @param {number[]} box of the real object, x0, y0, x1, y1 in pixels
   * @param {{pitchDeg: number} | null} [ground] that came with the light; null: guessed
   */
  setPhoto(width, height, lensDeg, mask, box, ground = null) {
    const longFovDeg = lensDeg ?? DEFAULT_LONG_FOV_DEG;
    const isSame = [width, height, ...box].join() === [this.width, this.height, ...(this.box ?? [])].join();
    Object.assign(this, { mask, width, height, longFovDeg, box, contact: contactOf(mask, width, box) });
    this.setMask(mask);
    const half = Math.tan((longFovDeg * Math.PI) / 360) * (height / Math.max(width, height));
    this.camera.fov = (2 * Math.atan(half) * 180) / Math.PI;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (isSame && this.isTouched) return this.setPitch(this.pitchDeg); // what was moved stays where it is
    this.isTouched = false;
    const focal = this.#focalPx();
    this.setPitch(ground ? seenPitchDeg(ground.pitchDeg, this.contact[1], height, focal) : likelyPitchDeg(this.contact[1], height, focal));
  }

  /** The real object hides what lies behind it: shadows on the ground, and the virtual object there. */
  setMask(mask) {
    this.realObject.show({ data: mask, width: this.width, height: this.height }, DISTANCE, this.#focalPx());
  }

  /** Put the object beside the real one, all of it in the photo. */
  #standBeside() {
    const { mask, width, height, box, size } = this;
    const real = Math.max(box[3] - box[1], 0.6 * (box[2] - box[0]));
    const asked = (OF_REAL * real * DISTANCE) / this.#focalPx();
    const farRow = height / 2 - this.#focalPx() * Math.tan((this.pitchDeg * Math.PI) / 180) + BELOW_HORIZON * height;
    const extentAt = ({ x, y, share }) => {
      this.#setFoot(x, Math.max(y, farRow));
      this.standing.scale.setScalar(asked * share * size);
      this.standing.updateWorldMatrix(true, false);
      const clip = new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.standing.matrixWorld);
      return extentOf(this.outline, clip, width, height);
    };
    const [, row] = this.contact;
    const { x, y, share, isBehind } = findSpot({ mask, width, box, row, behind: this.#rowBehind(asked) }, extentAt);
    this.unit = asked * share;
    this.isBehind = isBehind;
    this.#setFoot(x, Math.max(y, farRow));
    this.#place();
  }

  /** Row of the ground that lies behind the real object, as deep as wide, by what stands there. */
  #rowBehind(room) {
    const { height, box, up, ground } = this;
    const away = DISTANCE + ((box[2] - box[0]) / 2 / this.#focalPx()) * DISTANCE + room / 2;
    return height / 2 - (this.#focalPx() * (up.dot(ground.position) + up.z * away)) / up.y / away;
  }

  /** Whoever moved or scaled the object finds it where it was left; until then it stands beside the real one. */
  #stand() {
    if (this.box && this.object && !this.isTouched) this.#standBeside();
    else this.#place();
  }

  #focalPx() {
    return Math.max(this.width, this.height) / 2 / Math.tan((this.longFovDeg * Math.PI) / 360);
  }

  /** How far the camera looks down, degrees: the slope of the ground in the picture. */
  setPitch(degrees) {
    this.pitchDeg = degrees;
    const angle = (degrees * Math.PI) / 180;
    this.up = new Vector3(0, Math.cos(angle), Math.sin(angle));
    this.ground.quaternion.copy(new Quaternion().setFromUnitVectors(UP, this.up));
    if (this.contact) {
      const foot = pixelDirection(this.contact, this.width, this.height, this.longFovDeg);
      this.ground.position.set(...foot).multiplyScalar(DISTANCE);
    }
    this.ground.updateMatrixWorld(true);
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
    if (!this.object) return this.#aimShadow();
    this.standing.scale.setScalar((this.unit ?? 1) * this.size);
    this.contactShadow.scale.setScalar(1.1 * this.object.userData.width);
    this.#aimShadow();
  }

  /** Move the object to where the ground lies behind a pixel of the photo; false if none does. */
  moveTo(x, y) {
    this.isTouched = true;
    this.isBehind = false;
    const isGround = this.#setFoot(x, y);
    if (isGround) this.#aimShadow();
    return isGround;
  }

  #setFoot(x, y) {
    const direction = new Vector3(...pixelDirection([x, y], this.width, this.height, this.longFovDeg));
    const plane = new Plane().setFromNormalAndCoplanarPoint(this.up, this.ground.position);
    const caster = new Raycaster(new Vector3(), direction.normalize());
    const hit = caster.ray.intersectPlane(plane, new Vector3());
    if (!hit || hit.length() > 6 * DISTANCE || hit.length() < 0.1 * DISTANCE) return false;
    this.standing.position.copy(this.ground.worldToLocal(hit));
    return true;
  }

  /** Where the object stands in the camera's frame, the ground's normal there, its unit's length, and the field of view. */
  pose() {
    const foot = this.standing.getWorldPosition(new Vector3()).toArray();
    return { foot, up: this.up?.toArray(), scale: this.standing.scale.x, longFovDeg: this.longFovDeg };
  }

  /** What is to be said of the object's place: empty where all of it is in the photo, and nothing hides it. */
  placeNote() {
    if (!this.object || !this.box) return "";
    if (this.isBehind) return "There is no room beside the object: the virtual one stands behind it. Drag it.";
    this.standing.updateWorldMatrix(true, false);
    const clip = new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.standing.matrixWorld);
    const [x0, y0, x1, y1] = extentOf(this.outline, clip, this.width, this.height);
    const isInside = x0 >= 0 && y0 >= 0 && x1 <= this.width && y1 <= this.height;
    return isInside ? "" : "Part of the virtual object is outside the photo.";
  }

  /** Pixel of the photo where the object stands. */
  footPx() {
    const point = this.standing.getWorldPosition(new Vector3()).project(this.camera);
    return [((point.x + 1) / 2) * this.width, ((1 - point.y) / 2) * this.height];
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
    this.light = light;
    this.scene.environment = this.environment.update(light.prefiltered);
    this.#aimShadow();
  }

  /** Let the dominant light cast the object's shadow, as dark as its share of the ground's light is. */
  #aimShadow() {
    if (!this.canDraw || !this.light || !this.up) return;
    const { dominant } = this.light;
    const towards = new Vector3(...dominant.direction);
    const cosine = Math.max(towards.dot(this.up), 0);
    this.catcher.material.opacity = groundShadowOpacity(this.light, this.up.toArray());
    const foot = this.standing.getWorldPosition(new Vector3());
    const reach = 2 * (this.unit ?? 1) * this.size;
    this.catcher.visible = this.shadowLight.castShadow = cosine > 0.05;
    this.shadowLight.target.position.copy(foot);
    this.shadowLight.position.copy(foot).addScaledVector(towards, 3 * reach);
    const { shadow } = this.shadowLight;
    Object.assign(shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, far: 6 * reach });
    shadow.camera.near = 0.1 * reach;
    shadow.camera.updateProjectionMatrix();
    shadow.radius = 2 + 6 * Math.min((dominant.radiusDeg * Math.PI) / 180, 1);
    this.shadowLight.target.updateMatrixWorld();
    this.catcher.scale.setScalar(CATCHER * reach);
    this.catcher.position.copy(this.standing.position);
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
    if (!this.canDraw || !width || !height || !this.box) return;
    const size = renderer.getDrawingBufferSize(new Vector2());
    if (size.x !== Math.floor(width * ratio) || size.y !== Math.floor(height * ratio)) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
    }
    this.ground.visible = this.light !== undefined;
    renderer.render(this.scene, this.camera);
    if (this.isSoftware) await showDrawn(renderer.getContext(), canvas);
  }
}
