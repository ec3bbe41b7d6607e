/// <reference lib="esnext.disposable" />

/** anyprobe: the light around an object of one material, from its picture, in the browser. */

import type { Hints, LightOptions } from "./inputs.js";

export type { Hints, LightOptions };

export type Vector3 = [number, number, number];
export type Point = [x: number, y: number];

/** A texture of WebGL, such as XRWebGLBinding.getCameraImage gives of an XRFrame's view. */
export interface CameraTexture {
  gl: WebGL2RenderingContext;
  texture: WebGLTexture;
  width: number;
  height: number;
}

/** Pixels in memory: RGBA bytes, not premultiplied. */
export interface Picture {
  width: number;
  height: number;
  rgba: Uint8ClampedArray | Uint8Array;
}

export type Drawable =
  | HTMLImageElement
  | HTMLVideoElement
  | HTMLCanvasElement
  | OffscreenCanvas
  | ImageBitmap
  | VideoFrame
  | ImageData;

/** An address and a Blob or File are fetched and decoded; an image is waited for. */
export type ImageSource = string | URL | Blob | Drawable | CameraTexture | Picture;

/** What a program can ask of an error; see AnyProbeError. */
export type ErrorCode =
  | "invalid-option"
  | "invalid-image"
  | "no-object"
  | "unsupported"
  | "fetch-failed"
  | "worker-failed"
  | "disposed"
  | "failed";

/** Whatever this package throws, but an AbortSignal's own reason. */
export declare class AnyProbeError extends Error {
  readonly name: "AnyProbeError";
  readonly code: ErrorCode;
  /** The same as data, for a page's own words. */
  readonly notice: Notice & { code: ErrorCode };
  constructor(code: ErrorCode, text: string, options?: ErrorOptions & Partial<Pick<Notice, "subject" | "remedy">>);
}

/** Bytes of one file; total is null where the server does not say it; stalled: none has come for ten seconds. */
export interface Progress {
  file: string;
  loaded: number;
  total: number | null;
  stalled: boolean;
}

export interface Cancellable {
  /** Rejects with its reason. */
  signal?: AbortSignal;
}

export interface LoadOptions extends Cancellable {
  /** At most 4, and 1 on pages that are not cross-origin isolated. Default: one a core. */
  threads?: number;
  /** Graphs in the place of those in this package, or beside them. */
  weights?: MaskGraphs | (LightGraphs & MaskGraphs);
  /** Folder of onnxruntime-web's files, or its module and .wasm. Default: as the bundler or the import map has it. */
  runtime?: string | URL | { module: string; wasm: string };
  /** Address of the thread's script, or what starts it. */
  worker?: string | URL | (() => Worker);
  onProgress?: (progress: Progress) => void;
}

/** The network of the light. */
export interface LightGraphs {
  light: Graph;
}
/** mask is small and in this package; u2netp is far better: await AnyProbe.fetchMaskNetwork(address). */
export interface MaskGraphs {
  mask?: Graph;
  u2netp?: Graph;
}

/** Address, address and hash, or bytes. */
export type Graph = string | URL | { url: string; integrity?: string } | Uint8Array;

/** The angle that the picture takes in; at most one of them. Default: 60 degrees along the longer side. */
export interface Lens {
  /** Vertical field of view, degrees, as three.js's cameras have it. */
  fovDeg?: number;
  /** Of the longer side, degrees. */
  longFovDeg?: number;
  /** Of the camera that took the picture, column by column: an XRView's, or a three.js camera's Matrix4. */
  projectionMatrix?: ArrayLike<number> | { elements: ArrayLike<number> };
}

/** Our own, or a measured one as `anyprobe materials` lists them, like "porcelain". */
export type MaterialName = "chrome" | "gold" | "plastic" | "matte" | (string & {});
/** A name, or "matte" where none is given, with a linear diffuse albedo and a roughness (0.1 to 1) of its own. */
export type GivenMaterial =
  | MaterialName
  | { name?: MaterialName; albedo?: number | [number, number, number]; roughness?: number };

/**
 * A mask, white on the object, or opaque there: numbers in [0, 1] of the picture's size, or with width and height of its aspect (what
 * AnyProbe.mask gives, a light's, an MPMask of MediaPipe), or a picture of its aspect; null: none.
 */
export type GivenMask =
  | null
  | Float32Array
  | Mask
  | { width: number; height: number; getAsFloat32Array(): Float32Array }
  | Exclude<ImageSource, CameraTexture | Picture>;

export interface EstimateOptions extends Hints, Lens, LightOptions, Cancellable {
  /** In the place of click, exclude and box. One that was found keeps its quality and warnings. */
  mask?: GivenMask;
  /** Normals of the object in the camera's frame, three numbers a pixel of the picture, unit, zero where unknown. */
  normals?: Float32Array;
}

/** What `track` follows, of a stream its first video track; null: frames are offered. */
export type TrackSource = HTMLVideoElement | HTMLCanvasElement | OffscreenCanvas | MediaStreamTrack | MediaStream | null;
/** What holds one frame. */
export type FrameSource = HTMLVideoElement | Exclude<Drawable, HTMLVideoElement> | CameraTexture;
/** Of a camera in the world: 16 numbers column by column (a Matrix4, an XRRigidTransform, a three.js camera), or nine of its rotation row by row. */
export type Pose =
  | ArrayLike<number>
  | { elements: ArrayLike<number> }
  | { matrix: ArrayLike<number> }
  | { matrixWorld: { elements: ArrayLike<number> } };

export interface TrackOptions extends Hints, Lens, LightOptions, Cancellable {
  /**
   * Where the object is: in the first frame, from which it is followed; or a function that says it of every frame, such as a
   * segmenter of the app's, null where the object is not in it. In the place of click, exclude and box.
   */
  mask?: GivenMask | ((frame: FrameSource) => GivenMask | Promise<GivenMask>);
  /** The camera's pose, asked for whenever a frame is taken: the lights are then in the world, and still there while it turns. */
  pose?: () => Pose;
  /** What ends the tracking, once: a fault, or a camera's track that has ended. */
  onError?: (error: AnyProbeError) => void;
  /** No object is seen in a frame: it has left, or what was marked first has found none. */
  onLost?: () => void;
  /** What tracker.mark marked last found nothing: the object before it is followed on. */
  onMissed?: () => void;
}

/** A lobe of the map that a directional light stands for. */
export interface LightSource {
  /** Unit vector towards the light. */
  direction: Vector3;
  /** Of a plane that faces it. */
  irradiance: Vector3;
  /** Power over its largest channel. */
  color: Vector3;
  /** Integral of its radiance over its directions, sr. */
  power: Vector3;
  /** Of the even disc that spreads as much about the direction, degrees. */
  radiusDeg: number;
  /** Probability that it is a source. */
  exists: number;
  /** Degrees: how far off the direction is at most in two of three maps that are estimates. */
  errorDeg: number;
}

/**
 * Linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white. Right-handed frame of
 * the camera: +X right, +Y up, it looks along -Z.
 */
export declare class Light {
  /** Of what postMessage or structuredClone has made of one, which is without its environment and isSoft. */
  constructor(copy: Omit<Light, "environment" | "isSoft">);
  /** 27 radiance coefficients of spherical harmonics, order and constants of WebXR and three.js. */
  readonly sh9: Float32Array;
  /** The dominant one first; none of an even map. */
  readonly sources: LightSource[];
  /** The first of them; one without power where the map is even. */
  readonly dominant: LightSource;
  /** In [0, 1]: how much of all light comes from one side. */
  readonly directionality: number;
  /**
   * Equirectangular RGBA floats, 128 x 64: row 0 is +Y, the centre column -Z. For three.js use EnvironmentTexture or ProbeLight of
   * anyprobe/three, or a DataTexture with flipY = true and scene.environmentRotation.y = Math.PI / 2.
   */
  readonly environment: { width: number; height: number; data: Float32Array };
  /** 64 x 128: how likely each pixel's display value is within 0.1 of the truth. */
  readonly confidence: Float32Array;
  /** Of the photo's camera, and who says so: an option, the file, the network or nobody. */
  readonly lens: { longFovDeg: number; source: "given" | "exif" | "estimated" | "default" };
  /** Its mean over the sphere. */
  readonly meanConfidence: number;
  /** 64 x 128 x 3. */
  readonly radiance: Float32Array;
  /** The map blurred for each roughness, six faces a level, as EnvironmentTexture of anyprobe/three takes it. */
  readonly prefiltered: Float32Array[];
  /** Share of the object's pixels that are neither black nor clipped. */
  readonly wellExposedFraction: number;
  /** Probability that no light source dominates. */
  readonly soft: number;
  /** Whether none does, so that the light has no one direction. */
  readonly isSoft: boolean;
  /** What the object is taken for: probability of a metal, share of an even light that it reflects. */
  readonly object: { metal: number; reflectance: Vector3; reflectanceStops: number };
  /** How far off the map is in two of three cases: its level, and its mean colour. */
  readonly uncertainty: { levelStops: number; colorDeg: number };
  /** The share of the map that the background shows; whether normals and material were given. */
  readonly hints: { surroundings: number; normals: boolean; material: boolean };
  /**
   * What the object stands on, as far as the camera looks down on it, is turned to the left about its axis, and at the pixel where
   * the object touches it; null of a cut-out.
   */
  readonly ground: {
    pitchDeg: number;
    pitchErrorDeg: number;
    rollDeg: number;
    contact: [number, number];
    source: "given" | "estimated";
  } | null;
  /** What makes it doubtful though nothing failed: of the mask where it was found, of a black or clipped object, of the camera's pitch. */
  readonly warnings: string[];
  /** The same as data, for pages that put them into their own words. */
  readonly notices: Notice[];
  /** Of a tracked frame that came with a pose: directions are in the world. */
  readonly isInWorld?: boolean;
  /** Where the object is, as MaskOccluder of anyprobe/three takes it. */
  readonly mask: Mask | null;
}

/** What is doubtful: its code, a text without the names of options, and the options that mend it. */
export interface Notice {
  code: string;
  /** Options concerned. */
  subject: string[];
  text: string;
  /** Any of them mends it. */
  remedy: { do: "give" | "leave out" | "run"; name: string; value?: string }[];
}

/** Numbers in [0, 1], 1 on the object. */
export interface Mask {
  data: Float32Array;
  width: number;
  height: number;
  /** The expected IoU of a mask that was found, see AnyProbe.mask; null where it was given. */
  quality?: number | null;
  /** Of a still picture's. */
  warnings?: string[];
  notices?: Notice[];
}

/** What AnyProbe.mask found. */
export interface FoundMask extends Mask {
  quality: number;
  warnings: string[];
  notices: Notice[];
  /** How long the search took, without the opening of a network. */
  seconds: number;
}

export interface Tracker {
  readonly running: boolean;
  /**
   * A frame of one's own: in an XR session's callback, the camera's texture and the view's pose. mask: where the object is in
   * it. time: of performance.now(), when it was taken. Settles when the frame may be changed or closed; rejects where one of them is
   * wrong, and the tracking goes on; after onError with that error.
   */
  offer(frame: FrameSource, about?: { pose?: Pose; mask?: GivenMask; time?: number }): Promise<void>;
  /** The object is somewhere else, in the source's pixels. Where nothing is found there, the one before is followed on. */
  mark(hints?: Hints): Promise<void>;
  /** Another kind of light; what is not named stays as it is. */
  set(options?: LightOptions): Promise<void>;
  /** Lights, and frames of the source or offered, a second. */
  rates(): { updates: number; frames: number };
  stop(): void;
}

export declare class AnyProbe {
  private constructor();
  /** Open the light's network in a thread of its own; masks get another when first wanted. Rejects with one line that says what is missing. */
  static load(options?: LoadOptions): Promise<AnyProbe>;
  /** The better mask network, for weights.u2netp, from the address of u2netp.onnx; fetched once, and kept in the browser's cache. */
  static fetchMaskNetwork(address: string | URL, options?: { onProgress?: (progress: Progress) => void }): Promise<Uint8Array>;
  readonly threads: number;
  readonly hasMask: boolean;
  /** What finds objects. */
  readonly maskNetwork: "u2netp" | "small" | null;
  /**
   * Numbers in [0, 1], of the picture's size or of 1600 pixels along its longer side; and its quality: the expected IoU,
   * with a line on what looks wrong where that is little, and one where weights.u2netp is missing.
   */
  mask(image: ImageSource, options?: Hints & Cancellable): Promise<FoundMask>;
  /** The light around the object of one picture, in the frame of its camera. */
  estimate(image: ImageSource, options?: EstimateOptions): Promise<Light>;
  /** The light of every frame of a playing video, a canvas or a camera's track, steady on a still scene. One source at a time. */
  track(source: TrackSource, onLight: (light: Light) => void, options?: TrackOptions): Tracker;
  /** End the thread. What was asked of it, and is from here on, rejects with the code "disposed". */
  dispose(): void;
  [Symbol.dispose](): void;
}

/** Irradiance of a plane with a unit normal, [x, y, z], from radiance coefficients. */
export declare function irradiance(sh9: Float32Array, normal: Vector3): Vector3;
/** Opacity of black on ground with this normal, in the light's frame, where the dominant light is hidden. */
export declare function groundShadowOpacity(light: Pick<Light, "dominant" | "sh9">, up: Vector3): number;
/** Opacity of black that takes a share of the light away. */
export declare function shadowOpacity(share: number): number;
/** The curve is (1 + SIGMA) x^EXPONENT / (x^EXPONENT + SIGMA). */
export declare const EXPONENT: number, SIGMA: number;
/** The camera's curve: radiance to a display value in [0, 1]. */
export declare function response(radiance: number): number;
export declare function inverseResponse(display: number): number;
/**
 * A map of `height` rows, three numbers a pixel, as a Radiance file (.hdr), the centre column -Z: what HDRLoader of three.js reads
 * needs scene.environmentRotation.y = Math.PI / 2.
 */
export declare function encodeHdr(radiance: Float32Array, height: number): Uint8Array<ArrayBuffer>;
