/** anyprobe: the light around an object of one material, from its picture, in the browser. */

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
  rgba: Uint8ClampedArray;
}

export type ImageSource =
  | HTMLImageElement
  | HTMLVideoElement
  | HTMLCanvasElement
  | OffscreenCanvas
  | ImageBitmap
  | VideoFrame
  | ImageData
  | CameraTexture
  | Picture;

export interface LoadOptions {
  /** What runs the networks; "webgpu" is refused where the browser has none. Default "wasm". */
  engine?: "wasm" | "webgpu";
  /** Of WASM, at most 4, and 1 on pages that are not cross-origin isolated. Default: one a core. */
  threads?: number;
  /** Address, address and hash, or bytes of each graph. Default: those in this package. */
  weights?: Record<string, string | { url: string; integrity: string } | Uint8Array>;
  /** Folder of onnxruntime-web's files, with a slash. Default: as the bundler or the import map has it. */
  runtime?: string | { module: string; wasm: string };
  onProgress?: (progress: { done: number; of: number }) => void;
}

/** Where the object is, in pixels of the picture. Without any the mask network proposes the object. */
export interface Hints {
  /** On the object. */
  click?: Point | Point[];
  /** Beside it. */
  exclude?: Point | Point[];
  /** Around it. */
  box?: [x0: number, y0: number, x1: number, y1: number];
}

export interface LightOptions {
  /** The picture's background becomes part of the environment map. */
  surroundings?: boolean;
  /** Light sources at their most likely positions (sharp shadows), or their mean radiance (soft). Default "mode". */
  emitters?: "mode" | "expected";
  /** Field of view of the longer side, degrees. Default 65, a phone's main camera. */
  fovDeg?: number;
  /** What the object is made of: settles level and colour of the light, which a photo alone leaves open. */
  material?: GivenMaterial;
}

export type MaterialName = "chrome" | "gold" | "plastic" | "matte";
/** A name, or "matte" where none is given, with a linear diffuse albedo and a roughness (0.1 to 1) of its own. */
export type GivenMaterial =
  | MaterialName
  | { name?: MaterialName; albedo?: number | [number, number, number]; roughness?: number };

export interface EstimateOptions extends Hints, LightOptions {
  /** White on the object: a picture, or numbers in [0, 1] of the picture's size. */
  mask?: Float32Array | Exclude<ImageSource, CameraTexture | Picture>;
  /** Normals of the object in the camera's frame, three numbers a pixel of the picture, unit, zero where unknown. */
  normals?: Float32Array;
}

export interface TrackOptions extends Hints, LightOptions {
  onError?: (error: Error) => void;
  /** No object is seen in a frame. */
  onLost?: () => void;
}

/** The one lobe that a directional light stands for. */
export interface DominantLight {
  /** Unit vector towards the light. */
  direction: Vector3;
  /** Of a plane that faces it. */
  irradiance: Vector3;
  color: Vector3;
  /** Steradians. */
  solidAngle: number;
  /** In [0, 1]: how much of all light comes from one side. */
  directionality: number;
  pixels: number[];
  surrounding: Vector3;
}

/**
 * Linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white. Right-handed frame of
 * the camera: +X right, +Y up, it looks along -Z.
 */
export declare class Light {
  /** 27 radiance coefficients of spherical harmonics, order and constants of WebXR and three.js. */
  readonly sh9: Float32Array;
  readonly dominant: DominantLight;
  /** Equirectangular RGBA floats, 128 x 64: row 0 is +Y, the centre column -Z. */
  readonly environment: { width: number; height: number; data: Float32Array };
  /** 64 x 128: how likely each pixel's display value is within 0.1 of the truth. */
  readonly confidence: Float32Array;
  /** Its mean over the sphere. */
  readonly meanConfidence: number;
  /** 64 x 128 x 3. */
  readonly radiance: Float32Array;
  /** The map blurred for each roughness, six faces a level, as EnvironmentTexture of anyprobe/three takes it. */
  readonly prefiltered: Float32Array[];
  /** Share of the object's pixels that are neither black nor clipped. */
  readonly wellExposedFraction: number;
  readonly emitters: "mode" | "expected";
  /** What the object is taken for: probability of a metal, share of an even light that it reflects; null where unknown. */
  readonly object: { metal: number; reflectance: Vector3; reflectanceStops: number } | null;
  /** How far off the map is in two of three cases: its level, and its mean colour; null where unknown. */
  readonly uncertainty: { levelStops: number; colorDeg: number } | null;
  /** What was given: the share of the map that the background shows, and whether normals and material were. */
  readonly priors: { surroundings: number; normals: boolean; material: boolean };
  /** Of an estimate from a picture: how good the found mask is, see AnyProbe.mask; quality is null where it was given. */
  readonly mask?: { quality: number | null; warnings: string[] };
}

export interface Tracker {
  readonly running: boolean;
  /** The object is somewhere else, in the video's pixels. */
  mark(hints: Hints): Promise<void>;
  set(options: Pick<LightOptions, "surroundings" | "emitters">): Promise<void>;
  /** Lights and frames a second. */
  rates(): { updates: number; frames: number };
  stop(): void;
}

export declare class AnyProbe {
  private constructor();
  /** Open the networks in a thread of their own. Rejects with one line that says what is missing. */
  static load(options?: LoadOptions): Promise<AnyProbe>;
  readonly engine: "wasm" | "webgpu";
  readonly threads: number;
  readonly hasMask: boolean;
  /**
   * Numbers in [0, 1], of the picture's size or of 1600 pixels along its longer side; and its quality: the IoU to expect,
   * null without a mask network, with a line on what looks wrong where that is below 0.81.
   */
  mask(image: ImageSource, hints?: Hints): Promise<{ mask: Float32Array; width: number; height: number; quality: number | null; warnings: string[] }>;
  /** The light around the object of one picture, in the frame of its camera. */
  estimate(image: ImageSource, options?: EstimateOptions): Promise<Light>;
  /** The light of every frame of a playing video, steady on a still scene. One video at a time. */
  track(video: HTMLVideoElement, onLight: (light: Light) => void, options?: TrackOptions): Tracker;
  dispose(): void;
}

/** Irradiance of a plane with a unit normal from radiance coefficients. */
export declare function irradiance(sh9: Float32Array, normal: Vector3): Vector3;
/** The camera's curve: radiance to a display value in [0, 1]. */
export declare function response(radiance: number): number;
export declare function inverseResponse(display: number): number;
/** A map of `height` rows, three numbers a pixel, as an OpenEXR file. */
export declare function encodeExr(radiance: Float32Array, height: number): Uint8Array;
/** The same as a Radiance file (.hdr). */
export declare function encodeHdr(radiance: Float32Array, height: number): Uint8Array;
