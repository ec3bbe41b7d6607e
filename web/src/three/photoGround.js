/** The ground that the real object of a photo stands on: things stand on it at a pixel, and cast their shadow there. */

import { Box3, Group, Mesh, PerspectiveCamera, Plane, PlaneGeometry, Quaternion, Ray, ShadowMaterial, Sphere, Vector3 } from "three";
import { AnyProbeError } from "../errors.js";
import { checkNames, wrong } from "../checks.js";
import { groundShadowOpacity } from "../light/groundShadow.js";
import { contactOf, likelyPitchDeg, upOf } from "../photo/ground.js";
import { objectBox } from "../photo/picture.js";
import { ContactShadow } from "./contactShadow.js";

const UP = new Vector3(0, 1, 0);

/** Side of the plane that catches shadows, in radii of what stands on it. */
const CATCHER = 12;

/** Distance, in heights of the real object, beyond which ground counts as horizon. */
const FARTHEST = 8;

/** Width of a contact shadow, in widths of the object. */
const CONTACT = 1.1;

const SHADOW_PX = 1024;

/**
 * A group in the frame of the photo's camera, which looks along -Z from the origin; its own +Y is up and its origin the foot
 * of the real object, whose height is 1.
 */
export class PhotoGround extends Group {
  #up;
  #light;
  #view;

  /** The camera that took a light's photo, at the origin: of its lens, and of the aspect of its mask. */
  static camera(light) {
    const { mask, lens } = light ?? {};
    if (!mask || !lens) throw new AnyProbeError("invalid-option", "expected one with its mask and lens, got none; take it from probe.estimate", { subject: ["light"] });
    const half = Math.tan((lens.longFovDeg * Math.PI) / 360) * (mask.height / Math.max(mask.width, mask.height));
    return new PerspectiveCamera((Math.atan(half) * 360) / Math.PI, mask.width / mask.height);
  }

  constructor(light, camera, options = {}) {
    super();
    checkNames("PhotoGround", options);
    if (!(camera?.fov > 0)) throw wrong("camera", "a PerspectiveCamera", camera);
    const { data, width, height } = light?.mask ?? {};
    const box = data && objectBox(data, width);
    if (!box) throw new AnyProbeError("invalid-option", "expected one with the mask of its object, got none; take it from probe.estimate", { subject: ["light"] });
    const focal = height / 2 / Math.tan((camera.fov * Math.PI) / 360);
    const contact = contactOf(data, width, box);
    this.#view = { width, height, focal };
    this.#light = light;
    this.pitchDeg = likelyPitchDeg(contact[1], height, focal, options.pitchDeg ?? light.ground?.pitchDeg);
    this.#up = new Vector3(...upOf(this.pitchDeg));
    /** Of the real object's base along -Z, as MaskOccluder takes it with `focalPx`. */
    this.distance = focal / (box[3] - box[1]);
    this.focalPx = focal;
    this.quaternion.copy(new Quaternion().setFromUnitVectors(UP, this.#up));
    this.position.copy(this.#toward(contact)).multiplyScalar(this.distance);
    this.catcher = new Mesh(new PlaneGeometry(1, 1).rotateX(-Math.PI / 2), new ShadowMaterial({ toneMapped: false, depthWrite: false }));
    this.catcher.receiveShadow = true;
    this.catcher.visible = false;
    this.add(this.catcher);
    this.updateMatrixWorld(true);
  }

  /** Direction from the camera through a pixel of the mask, of depth 1. */
  #toward([x, y]) {
    const { width, height, focal } = this.#view;
    return new Vector3((x - width / 2) / focal, (height / 2 - y) / focal, -1);
  }

  /** The place on the ground that a pixel shows, in this group; null where it shows none. */
  at(pixel) {
    const plane = new Plane().setFromNormalAndCoplanarPoint(this.#up, this.position);
    const hit = new Ray(new Vector3(), this.#toward(pixel).normalize()).intersectPlane(plane, new Vector3());
    if (!hit || hit.length() > FARTHEST * this.distance) return null;
    return hit.sub(this.position).applyQuaternion(this.quaternion.clone().invert());
  }

  /** Stand an object on the ground: its lowest point touches it at a pixel, and a contact shadow lies under it. */
  stand(object, pixel) {
    const place = this.at(pixel);
    if (!place) {
      const { width, height } = this.#view;
      throw new AnyProbeError("invalid-option", `expected one of ${width} x ${height} that shows the ground, got ${pixel}, which is above it; choose a lower one`, { subject: ["pixel"] });
    }
    object.position.set(0, 0, 0);
    object.removeFromParent();
    object.updateMatrixWorld(true);
    const box = new Box3().setFromObject(object);
    const size = box.getSize(new Vector3());
    object.position.set(place.x, place.y - box.min.y, place.z);
    object.traverse((part) => part.isMesh && (part.castShadow = true));
    const contact = new ContactShadow();
    contact.scale.set(CONTACT * size.x, 1, CONTACT * size.z);
    contact.position.set(place.x, place.y + 0.002, place.z);
    object.userData.contact?.removeFromParent();
    object.userData.contact = contact;
    this.add(object, contact);
    return object;
  }

  /** Let the dominant light cast the shadows of all that stands here, as dark as its share of the ground's light is. */
  castFrom(lights) {
    this.updateMatrixWorld(true);
    const box = new Box3();
    for (const part of this.children) if (part !== this.catcher && !(part instanceof ContactShadow)) box.expandByObject(part);
    if (box.isEmpty()) return;
    const { center, radius } = box.getBoundingSphere(new Sphere());
    const { directionalLight } = lights;
    const away = directionalLight.position.length();
    lights.position.copy(center);
    directionalLight.castShadow = true;
    const { shadow } = directionalLight;
    const reach = 3 * radius;
    Object.assign(shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: away - 2 * radius, far: away + CATCHER * radius });
    shadow.camera.updateProjectionMatrix();
    shadow.mapSize.set(SHADOW_PX, SHADOW_PX);
    Object.assign(shadow, { radius: 4, bias: -0.0005, normalBias: 0.002 });
    this.catcher.material.opacity = groundShadowOpacity(lights.estimate ?? this.#light, this.#up.toArray());
    const foot = this.worldToLocal(center.clone());
    this.catcher.position.set(foot.x, 0, foot.z);
    this.catcher.scale.set(CATCHER * radius, 1, CATCHER * radius);
    this.catcher.visible = true;
  }

  /** Free GPU memory; the objects on it stay the caller's. */
  dispose() {
    this.catcher.geometry.dispose();
    this.catcher.material.dispose();
    for (const part of this.children) if (part instanceof ContactShadow) part.dispose();
  }
}
