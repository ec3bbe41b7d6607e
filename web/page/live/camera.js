/** The camera of this machine or phone. */

/** @returns {Promise<MediaStream>} the camera that looks away from the user where there are two */
export async function openCamera() {
  if (!navigator.mediaDevices) {
    throw new Error("Browsers give a camera to https pages and to localhost only. Start: anyprobe serve --https");
  }
  const video = { facingMode: "environment", width: { ideal: 1280 }, height: { ideal: 720 } };
  try {
    return await navigator.mediaDevices.getUserMedia({ video });
  } catch (error) {
    const reasons = {
      NotAllowedError: "The camera was not allowed. Allow it beside the address, and try again.",
      NotFoundError: "There is no camera here. Choose a photo instead.",
      NotReadableError: "Another program holds the camera. Close it, and try again.",
    };
    throw new Error(reasons[error.name] ?? `The camera could not be opened (${error.message}).`);
  }
}

/** Call onEnd if the camera stops by itself: unplugged, or withdrawn by the user or the system. */
export function watchCamera(stream, onEnd) {
  for (const track of stream.getVideoTracks()) {
    track.addEventListener("ended", () => onEnd(new Error("The camera has ended: it was unplugged or taken away.")));
  }
}

/** @param {MediaStream | null} stream */
export function closeCamera(stream) {
  for (const track of stream?.getTracks() ?? []) track.stop();
}
