/** anyprobe/three: estimates in three.js. */

import type { DirectionalLight, Group, LightProbe, Mesh, Object3D, Object3DEventMap, PerspectiveCamera, Texture, Vector3 as Place, WebGLRenderer } from "three";
import type { AnyProbe, Light, Mask, Tracker, TrackOptions, TrackSource, Vector3 } from "./index.js";

export interface ProbeLightEventMap extends Object3DEventMap {
  estimationstart: {};
  estimationend: {};
}

/** In the place of XREstimatedLight: the same fields and events. */
export declare class ProbeLight extends Group<ProbeLightEventMap> {
  constructor(probe: AnyProbe, environmentEstimation?: boolean);
  /** The light but the dominant one, as spherical harmonics; its intensity is 0 in a scene whose environment is this one's. */
  lightProbe: LightProbe;
  /** The dominant light, 5 units from the origin; set castShadow. */
  directionalLight: DirectionalLight;
  /** The light but the dominant one, for scene.environment; null unless it was asked for, which XREstimatedLight's type does not say either. */
  environment: Texture;
  /** The last light. */
  estimate: Light | null;
  /** camera: that took the picture, where it is not the scene's origin; its matrixWorld must be up to date. */
  update(light: Light, camera?: Object3D | null): void;
  /** camera: whose pose is asked for whenever a frame is taken, so that the light stays still in the world. */
  track(source: TrackSource, options?: TrackOptions & { camera?: Object3D | null }): Tracker;
  /**
   * In the animation loop of an XR session that was asked for with requiredFeatures: ["camera-access"]: follow the light of its
   * camera's picture, in the world. frame: an XRFrame, null outside a session. Whether there was a picture.
   */
  offerCamera(renderer: WebGLRenderer, frame: object | null | undefined, options?: TrackOptions): boolean;
  /** In that session: the object is what the ray of one of renderer.xr's controllers points at, as in its "select" event. */
  mark(controller: Object3D): Promise<void>;
  stop(): void;
  dispose(): void;
}

/** The whole light for scene.environment: one cube texture, used again for every light. */
export declare class EnvironmentTexture {
  readonly texture: Texture;
  update(levels: Light["prefiltered"]): Texture;
  dispose(): void;
}

/** Show radiance as the photo's camera does; before the first picture is drawn. */
export declare function installCameraCurve(renderer: WebGLRenderer): void;

/**
 * The ground that a photo's object stands on, in the frame of its camera, which looks along -Z from the origin. Its own +Y is up,
 * its origin the foot of the real object, whose height is 1.
 */
export declare class PhotoGround extends Group {
  /**
   * camera: of the photo's field of view. pitchDeg: how far it looks down, where it is known; default: as light.ground has it, 22
   * without one. Raised to where the object's foot is seen from above: ground that does not show can carry nothing.
   */
  constructor(light: Light, camera: PerspectiveCamera, options?: { pitchDeg?: number });
  /** The camera that took the light's photo, at the origin. */
  static camera(light: Light): PerspectiveCamera;
  readonly pitchDeg: number;
  /** Of the real object's base, as MaskOccluder takes it. */
  readonly distance: number;
  /** In the mask's pixels. */
  readonly focalPx: number;
  /** The plane that catches shadows. */
  readonly catcher: Mesh;
  /** The place on the ground that a pixel of the mask's size shows, in this group; null where it shows none. */
  at(pixel: readonly [x: number, y: number]): Place | null;
  /** Stand an object on the ground at a pixel, with a contact shadow under it. */
  stand<T extends Object3D>(object: T, pixel: readonly [x: number, y: number]): T;
  /** Let the dominant light cast the shadows of what stands here; again after a light or an object has changed. */
  castFrom(lights: ProbeLight): void;
  dispose(): void;
}

/** A soft round spot on the ground (+Y up), of side 1. */
export declare class ContactShadow extends Mesh {
  constructor(opacity?: number);
  dispose(): void;
}

export { groundShadowOpacity, shadowOpacity } from "./index.js";

/** The real object's depth: it hides what is behind it, and is not drawn itself. */
export declare class MaskOccluder {
  readonly group: Group;
  /** distance of the object's base along -Z; focalPx of the camera, in the mask's pixels. */
  show(mask: Mask, distance: number, focalPx: number): void;
  dispose(): void;
}
