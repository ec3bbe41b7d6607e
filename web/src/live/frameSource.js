/** What frames come from: each new one of a video, a canvas or a camera's track. */

import { AnyProbeError } from "../errors.js";
import { wrong } from "../options.js";

const isOf = (source, ...names) => names.some((name) => typeof globalThis[name] === "function" && source instanceof globalThis[name]);

/**
 * Call back with what holds each new frame, while it is wanted.
 *
 * @param {HTMLVideoElement | HTMLCanvasElement | OffscreenCanvas | MediaStreamTrack | null} source null: frames are offered
 * @param {(frame: object) => void} give
 * @returns {Promise<() => void>} ends it
 */
export async function follow(source, give) {
  if (source === null) return () => {};
  if (!isOf(source, "MediaStreamTrack")) return watch(source, give);
  if (source.kind !== "video") throw wrong("source", "a track of a camera", `one of kind ${source.kind}`);
  return typeof MediaStreamTrackProcessor === "function" ? process(source, give) : playHidden(source, give);
}

/** Width and height of a source in its own pixels; zeros while there is none yet. */
export function sizeOf(source) {
  const { width = 0, height = 0 } = isOf(source, "MediaStreamTrack") ? source.getSettings() : {};
  return [
    source.videoWidth ?? source.displayWidth ?? source.naturalWidth ?? source.width ?? width,
    source.videoHeight ?? source.displayHeight ?? source.naturalHeight ?? source.height ?? height,
  ];
}

/** Once for every picture that is shown. */
function watch(source, give) {
  let isOn = true;
  const next = () => {
    if (!isOn) return;
    give(source);
    if (source.requestVideoFrameCallback) source.requestVideoFrameCallback(next);
    else requestAnimationFrame(next);
  };
  next();
  return () => (isOn = false);
}

/** Frames as the camera gives them, no element and no page's drawing between. */
function process(track, give) {
  const reader = new MediaStreamTrackProcessor({ track, maxBufferSize: 1 }).readable.getReader();
  (async () => {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      await give(value);
      value.close();
    }
  })().catch(() => {}); // ended
  return () => reader.cancel().catch(() => {});
}

async function playHidden(track, give) {
  const video = Object.assign(document.createElement("video"), { muted: true, playsInline: true, srcObject: new MediaStream([track]) });
  try {
    await video.play();
  } catch (error) {
    throw new AnyProbeError("failed", `The camera's track could not be played: ${error.message}.`);
  }
  const stop = watch(video, give);
  return () => {
    stop();
    video.srcObject = null;
  };
}
