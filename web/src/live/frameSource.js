/** Sources of frames: a video, a canvas or a camera's track. */

import { AnyProbeError } from "../errors.js";
import { isOf, kindOf } from "../photo/source.js";

/** The source to follow; of a camera's stream, its first video track. @param {import("../../types/index.d.ts").TrackSource} source */
export function checkSource(source) {
  if (source === null) return null;
  const followed = typeof source?.getVideoTracks === "function" ? source.getVideoTracks()[0] : source;
  const isTrack = isOf(followed, "MediaStreamTrack");
  if (isTrack && followed.kind === "video" && followed.readyState !== "ended") return followed;
  const isVideo = followed?.videoWidth !== undefined;
  const isCanvas = typeof followed?.getContext === "function";
  if (isVideo && followed.networkState === 0) throw wrong("a video with a source", "one without; set its src or srcObject first");
  if (isCanvas && !(followed.width > 0 && followed.height > 0)) throw wrong("a canvas with pixels", `one of ${followed.width} x ${followed.height}`);
  if ((isVideo || isCanvas) && !isTrack) return followed;
  const expected = "a video element, a canvas, a camera's MediaStreamTrack or MediaStream, or null where frames are offered";
  throw wrong(expected, isTrack ? `a track of ${followed.kind}, ${followed.readyState}` : kindOf(source));
}

const wrong = (expected, got) => new AnyProbeError("invalid-option", `expected ${expected}, got ${got}`, { subject: ["source"] });

const FRAMES = "a video, a canvas, an image, an ImageBitmap, an ImageData, a VideoFrame or { gl, texture, width, height }";

/** Refuse what holds no frame. @param {import("../../types/index.d.ts").FrameSource} frame */
export function checkFrame(frame) {
  const hasSize = ["videoWidth", "displayWidth", "naturalWidth", "width"].some((name) => typeof frame?.[name] === "number");
  if (hasSize && !frame.rgba && Boolean(frame.texture) === Boolean(frame.gl)) return;
  throw new AnyProbeError("invalid-image", `expected ${FRAMES}, got ${kindOf(frame)}`, { subject: ["frame"] });
}

/**
 * Call back with each new frame until it is cancelled.
 *
 * @param {HTMLVideoElement | HTMLCanvasElement | OffscreenCanvas | MediaStreamTrack | null} source null: frames are offered
 * @param {(frame: object) => void} give
 * @param {(error: AnyProbeError) => void} onEnd hears when a camera's track has ended, or a video cannot be played
 * @returns {Promise<() => void>} stops it
 */
export async function follow(source, give, onEnd) {
  if (source === null) return () => {};
  if (!isOf(source, "MediaStreamTrack")) return watch(source, give, onEnd);
  const end = () => onEnd(new AnyProbeError("failed", "The camera's track has ended; open the camera, and track again."));
  source.addEventListener("ended", end);
  const stop = await playHidden(source, give, onEnd);
  return () => {
    source.removeEventListener("ended", end);
    stop();
  };
}

/** Once for every picture that is shown. */
function watch(source, give, onEnd) {
  let isOn = true;
  const fail = () => {
    const why = source.error?.message || "its file is not there, or of a kind that this browser does not play";
    onEnd(new AnyProbeError("failed", `The video cannot be played: ${why.replace(/\.$/, "")}.`));
  };
  if (source.error) fail();
  source.addEventListener?.("error", fail);
  const next = () => {
    if (!isOn) return;
    give(source);
    if (source.requestVideoFrameCallback) source.requestVideoFrameCallback(next);
    else requestAnimationFrame(next);
  };
  next();
  return () => {
    isOn = false;
    source.removeEventListener?.("error", fail);
  };
}

async function playHidden(track, give, onEnd) {
  const video = Object.assign(document.createElement("video"), { muted: true, playsInline: true, srcObject: new MediaStream([track]) });
  try {
    await video.play();
  } catch (error) {
    throw new AnyProbeError("failed", `The camera's track could not be played: ${error.message}.`);
  }
  const stop = watch(video, give, onEnd);
  return () => {
    stop();
    video.srcObject = null;
  };
}
