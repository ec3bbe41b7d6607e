"""A rendered layout as a phone photographs it, and its object's mask as people and programs draw it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.camera import SUBSAMPLINGS, compress, draw_curve
from anyprobe_train.dataset.mask_errors import disturb_mask, gross_error
from research.world.whole_render import Render

CONTRAST, SATURATION = 0.15, 0.18
"""Standard deviations of what a phone's picture style adds to contrast and saturation."""
VIGNETTE = 0.35
"""Most light, in shares, that a lens loses in its corners."""
LENS_KNOWN = 0.5
"""Share of the photos whose file says the lens."""
EXACT, GROSS = 0.3, 0.12
"""Shares of the masks without an error and with a gross one."""
LEAST_PX = 60
"""Pixels that stay of an object's mask."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TakenPhoto:
    """A photo and what is true of it.

    picture: [H, W, 3] uint8. mask, true_mask: [H, W] bool, as it is given and as it is. truth: [64, 128, 3] in the
    camera's frame and the photo's exposure units. long_fov_deg: of its longer side, None where the file does not say.
    """

    picture: np.ndarray
    mask: np.ndarray
    true_mask: np.ndarray
    truth: np.ndarray
    long_fov_deg: float | None


def take(render: Render, long_fov_deg: float, rng: np.random.Generator) -> TakenPhoto:
    """Photograph a render: metering, white balance, lens, curve, style, noise, 8 bits, JPEG."""
    mask = render.mask > 0.5
    gain = _gain(rng, render, mask)
    ambient = (render.truth * pixel_solid_angles(MAP_HEIGHT)[..., None]).sum(axis=(0, 1))
    balance = distributions.draw_white_balance(rng, ambient[None])[0]
    radiance = render.picture * (gain * balance).astype(np.float32)
    height, width = mask.shape
    if rng.random() < 0.4:
        y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
        radiance = radiance * (1 - rng.uniform(0, VIGNETTE) * (x * x + y * y) / 2)[..., None].astype(np.float32)
    if rng.random() < 0.5:
        radiance = _blurred(radiance, float(rng.uniform(0.3, 1.2)))
    display = _styled(response(radiance, curve=draw_curve(rng)), rng)
    grain = rng.standard_normal(display.shape, np.float32) * rng.uniform(0.0, 0.015)
    picture = np.round(np.clip(display + grain, 0.0, 1.0) * 255.0).astype(np.uint8)
    if rng.random() < 0.5:
        picture = compress(picture, int(rng.integers(50, 98)), SUBSAMPLINGS[rng.integers(len(SUBSAMPLINGS))])
    return TakenPhoto(
        picture=picture,
        mask=_drawn_mask(mask, rng),
        true_mask=mask,
        truth=(render.truth * gain * balance).astype(np.float32),
        long_fov_deg=long_fov_deg if rng.random() < LENS_KNOWN else None,
    )


def mirrored(render: Render) -> Render:
    """Return the same scene in a mirror."""
    picture, mask, truth = (np.ascontiguousarray(one[:, ::-1]) for one in (render.picture, render.mask, render.truth))
    return Render(picture=picture, mask=mask, truth=truth)


def _gain(rng: np.random.Generator, render: Render, mask: np.ndarray) -> float:
    """Return the factor from the render's units to the photo's."""
    bright = luminance(render.picture)
    frame = distributions.seen_level(bright)
    return distributions.draw_photo_gain(rng, float(bright[mask].mean()) if mask.any() else frame, frame)


def _blurred(radiance: np.ndarray, sigma: float) -> np.ndarray:
    import cv2

    return cv2.GaussianBlur(radiance, (0, 0), sigma)


def _styled(display: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return display values [H, W, 3] of another contrast about the middle and another saturation."""
    contrast, saturation = np.exp(rng.normal(0.0, CONTRAST)), np.exp(rng.normal(0.0, SATURATION))
    display = display.clip(0.0, 1.0)
    power = display**contrast
    display = power / (power + (1 - display) ** contrast)  # an s-curve; .5, black and white stay
    grey = luminance(display)[..., None]
    return grey + saturation * (display - grey)


def _drawn_mask(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the mask [H, W] with the errors of people and programs; a few are gross."""
    choice = rng.random()
    if choice < EXACT:
        return mask
    made = gross_error(mask, rng) if choice > 1 - GROSS else _disturbed(mask, rng)
    return made if made.sum() >= LEAST_PX and (made & mask).sum() > 0.4 * mask.sum() else mask


def _disturbed(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    height, width = mask.shape
    side = max(height, width)
    square = np.zeros((side, side), bool)
    square[:height, :width] = mask
    return disturb_mask(square, rng)[:height, :width]
