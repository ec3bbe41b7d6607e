"""The virtual object in the photo: its shadow on the ground, itself in front, through the camera's curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.response import inverse_response, response
from anyprobe.infer.photo import Photo
from anyprobe.relight.ground import Placement, View
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.surface import Camera

BORDER_PX = 2
"""Kept around the object's window for its soft edge."""

LEAST_SHADOW = 1 / 1024
"""A quarter of a display step; where less is missing the photo stays as it is."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """The square part of the photo that the object covers: its corner and side [px], and its camera."""

    left: int
    top: int
    size: int
    camera: Camera


def window_around(placement: Placement, view: View) -> Window | None:
    """The smallest square of whole pixels around what the photo shows of the object; None where that is nothing."""
    pixels, sides = view.pixels(placement.mesh.positions), np.array([view.width, view.height])
    low = np.floor(np.clip(pixels.min(axis=0), 0, sides)).astype(int)
    high = np.ceil(np.clip(pixels.max(axis=0), 0, sides)).astype(int)
    if (low >= high).any():
        return None
    low -= BORDER_PX
    size = int((high - low).max()) + BORDER_PX
    middle = low + size / 2
    camera = Camera(
        world_from_camera=np.eye(3),
        position=np.zeros(3),
        tan_half=size / 2 / view.focal,
        size=size,
        center=(
            float((middle[0] - view.width / 2) / view.focal),
            float((view.height / 2 - middle[1]) / view.focal),
        ),
    )
    return Window(left=int(low[0]), top=int(low[1]), size=size, camera=camera)


def cast_shadow(photo: Photo, view: View, shadow: GroundShadow) -> np.ndarray:
    """The photo [H, W, 3] with the shadow on its ground.

    The real object and what lies above the horizon get none; pixels that lose nothing keep their bits.
    """
    picture = photo.rgb.copy()
    for strip, ground in view.ground_strips():
        ratio = shadow.at(ground.reshape(-1, 3)).reshape(ground.shape)
        ratio = 1.0 - (1.0 - ratio) * (1.0 - photo.mask[strip, :, None])
        touched = (ratio < 1.0 - LEAST_SHADOW).any(axis=-1)
        under = picture[strip]
        under[touched] = response(inverse_response(under[touched]) * ratio[touched])
    return picture


def lay_over(
    picture: np.ndarray,
    drawn: np.ndarray,
    window: Window,
    photo: Photo,
    behind: bool = False,
) -> np.ndarray:
    """Lay an object [S, S, 4] (linear radiance, coverage) over a display picture [H, W, 3].

    Args:
        behind: whether the real object hides it.
    """
    height, width = picture.shape[:2]
    top, left = max(window.top, 0), max(window.left, 0)
    bottom, right = min(window.top + window.size, height), min(window.left + window.size, width)
    if top >= bottom or left >= right:
        return picture
    part = drawn[top - window.top : bottom - window.top, left - window.left : right - window.left]
    coverage = part[..., 3:]
    if behind:
        coverage = coverage * (1.0 - photo.mask[top:bottom, left:right, None])
    picture = picture.copy()
    under = picture[top:bottom, left:right]
    mixed = under + coverage * (response(part[..., :3]) - under)
    picture[top:bottom, left:right] = np.where(coverage > 0, mixed, under)
    return picture
