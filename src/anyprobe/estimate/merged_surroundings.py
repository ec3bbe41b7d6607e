"""Surroundings merged from several photos, in a fixed world frame.

One photo shows a window of the light; a turning camera shows more and more of it. A panorama is [64, 128, 4]: linear
radiance times cover, and cover in [0, 1]; with a fifth channel where surroundings have one, see estimate.surroundings.
Everything shown counts as infinitely far, as all light does here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.response import response
from anyprobe.estimate.known import GivenPanorama
from anyprobe.estimate.photo import Crop, Photo, crop_object
from anyprobe.estimate.runtime import PHOTO_SIZE
from anyprobe.estimate.surroundings import CLIPPED, LEAST_COVER, over, radiance_of, surroundings_of
from anyprobe.light.environment import rotate

if TYPE_CHECKING:
    from jaxtyping import Float

SHARED = 30
"""Smallest number of pixels that two windows must share to be compared."""
COMPARED = 0.02, 0.8
"""Radiance range in which two photos can be compared: neither noise nor clipped."""
DIFFER = 0.12
"""Mean difference of display values, exposure apart, above which the older view shows another light or place."""


def cut_out(photo: Photo, *, first: bool) -> Crop:
    """Return the crop of one photo of several; surroundings from a file are of the first one's frame alone."""
    is_foreign = not first and isinstance(photo.surroundings, GivenPanorama)
    return crop_object(replace(photo, surroundings=None) if is_foreign else photo, PHOTO_SIZE)


def window(surroundings_map: np.ndarray, world_from_crop: Float[np.ndarray, "3 3"], gain: float = 1.0) -> np.ndarray:
    """Return a photo's surroundings, see estimate.surroundings, as a panorama of the world.

    gain: that brings the photo to the panorama's exposure; made darker, clipped pixels carry no information.
    """
    radiance, clipped, cover = radiance_of(surroundings_map)
    layers = [cover, surroundings_map[..., 4:]]
    if gain < 1:
        layers = [layer * ~clipped.any(axis=-1, keepdims=True) for layer in layers]
    shown = np.concatenate([radiance * gain * layers[0], *layers], axis=-1)
    return np.maximum(rotate(shown.astype(np.float32), world_from_crop), 0.0)


def lay_over(newer: np.ndarray, older: np.ndarray | None) -> np.ndarray:
    """Return the newer panorama where it shows something, else the older, brought to the newer's exposure by what both
    show.

    older: None where there is none yet.

    Where both show the same place and differ, the older is dropped: a light was switched off, or the poses are wrong.
    """
    if older is None:
        return newer
    both = (newer[..., 3] > 0.5) & (older[..., 3] > 0.5)
    if both.sum() >= SHARED:
        now, then = (one[both, :3] / one[both, 3:4] for one in (newer, older))
        light = luminance(now), luminance(then)
        given = np.all([(one > COMPARED[0]) & (one < COMPARED[1]) for one in light], axis=0)
        gain = np.float32(np.median(light[0][given] / light[1][given])) if given.sum() >= SHARED else np.float32(1)
        if np.abs(response(now) - response(then * gain)).mean() > DIFFER:
            return newer
        older = np.concatenate([older[..., :3] * gain, older[..., 3:]], axis=-1)
    return over(newer, older)


def seen_from(
    panorama: np.ndarray, world_from_crop: Float[np.ndarray, "3 3"], own: np.ndarray | None, gain: float = 1.0
) -> np.ndarray:
    """Return the known part of a photo's map, see estimate.surroundings, in its crop's frame.

    own: the same by the photo itself, which counts where it shows something; None: it shows nothing. gain: of window;
        where it makes the panorama darker, clipped pixels there carry no information.
    """
    turned = rotate(panorama, world_from_crop.T)
    cover, measured = np.clip(turned[..., 3:4], 0.0, 1.0), np.clip(turned[..., 4:], 0.0, 1.0)
    radiance = np.maximum(turned[..., :3], 0.0) / np.maximum(cover, LEAST_COVER)
    known = surroundings_of(radiance / gain, cover, measured if measured.shape[-1] else None)
    if gain > 1:
        clipped = (response(radiance) >= CLIPPED).any(axis=-1, keepdims=True)
        known = known * (~clipped | (measured.sum(axis=-1, keepdims=True) >= 0.5 * cover))
    return known if own is None else over(own, known)
