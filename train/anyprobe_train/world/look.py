"""How a photo's camera renders light: exposure, white balance, vignette, blur, curve, style, noise, JPEG."""

from dataclasses import dataclass

import cv2
import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import CameraCurve, response
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.camera import draw_curve
from anyprobe_train.world.photo import Frame
from anyprobe_train.world.windows import Window

CONTRAST, SATURATION = 0.15, 0.18
"""Standard deviations of what a phone's picture style adds to contrast and saturation."""
VIGNETTE = 0.35
"""Most light, in shares, that a lens loses in its corners."""
LONG_PX = (260, 4000)
"""Bounds of the photo's longer side; even in the logarithm."""
NOISE = 0.02


@dataclass(frozen=True, kw_only=True, slots=True)
class Look:
    """Settings of one photo: gain [3] from the scene's units to the photo's; blur of the lens [pixels of the object's
    window]; noise of display values; long_px of the photo; the rest as their names say."""

    gain: np.ndarray
    vignette: float
    blur: float
    curve: CameraCurve
    contrast: float
    saturation: float
    noise: float
    long_px: float
    quality: int | None


def draw_look(rng: np.random.Generator, object_mean: float | None, frame: np.ndarray, truth: np.ndarray) -> Look:
    """Draw a camera that meters the luminance of pixels [N] of the frame and of the object, in light [64, 128, 3]; of a
    cut-out, which has no frame, of the light that stood behind it. distributions.draw_photo_gain draws the exposure."""
    level = distributions.seen_level(frame) if len(frame) else float(distributions.frame_level(luminance(truth)))
    gain = distributions.draw_photo_gain(rng, level if object_mean is None else object_mean, level)
    ambient = (truth * pixel_solid_angles(len(truth))[..., None]).sum(axis=(0, 1))
    balance = distributions.draw_white_balance(rng, ambient[None])[0]
    return Look(
        gain=(gain * balance).astype(np.float32),
        vignette=float(rng.uniform(0, VIGNETTE)) if rng.random() < 0.4 else 0.0,
        blur=float(rng.uniform(0.3, 1.2)) if rng.random() < 0.5 else 0.0,
        curve=draw_curve(rng),
        contrast=float(np.exp(rng.normal(0.0, CONTRAST))),
        saturation=float(np.exp(rng.normal(0.0, SATURATION))),
        noise=float(rng.uniform(0.0, NOISE)),
        long_px=float(np.exp(rng.uniform(*np.log(LONG_PX)))),
        quality=int(rng.integers(45, 98)) if rng.random() < 0.5 else None,
    )


def develop(
    look: Look, radiance: np.ndarray, window: Window, frame: Frame, blur: float, rng: np.random.Generator
) -> np.ndarray:
    """Return a window of the photo's plane as its file shows it, [S, S, 3] uint8, by area.

    radiance: [S, S, 3] in the scene's units; blur: of the lens [pixels of the window].
    """
    size = len(radiance)
    radiance = radiance * look.gain
    if look.vignette:
        x, y = (np.linspace(a, b, size, dtype=np.float32) for a, b in (window[:2], window[2:]))
        radius = (x[None] ** 2 + y[:, None] ** 2) / (frame.tangents[0] ** 2 + frame.tangents[1] ** 2)
        radiance = radiance * (1 - look.vignette * np.minimum(radius, 1.0))[..., None]
    if blur > 0.15:
        radiance = cv2.GaussianBlur(radiance, (0, 0), blur)
    own = (window[1] - window[0]) / (2 * frame.most) * look.long_px  # pixels of the photo along the window
    small = max(int(round(own)), 8)
    if small < size:
        radiance = cv2.resize(radiance, (small, small), interpolation=cv2.INTER_AREA)
    display = _styled(response(radiance, curve=look.curve), look)
    noise = look.noise * min(1.0, size / own)
    display = display + noise * rng.standard_normal(display.shape, np.float32)
    picture = np.round(np.clip(display, 0.0, 1.0) * 255.0).astype(np.uint8)
    if look.quality is not None and own < 2 * size:
        picture = cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, look.quality])[1], 1)
    return cv2.resize(picture, (size, size), interpolation=cv2.INTER_LINEAR) if small < size else picture


def _styled(display: np.ndarray, look: Look) -> np.ndarray:
    """Return display values of another contrast about the middle and another saturation."""
    display = display.clip(1e-4, 1.0)
    display = 1.0 / (1.0 + (1.0 / display - 1.0) ** look.contrast)  # an s-curve; .5, black and white stay
    grey = luminance(display)[..., None]
    return grey + look.saturation * (display - grey)
