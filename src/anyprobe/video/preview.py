"""A light as one frame of a clip: its map, and a matte, a silver and a mirror sphere under it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.light.environment import reduced
from anyprobe.masks.resize import resize
from anyprobe.render.spheres import sphere_images

if TYPE_CHECKING:
    from jaxtyping import Float, UInt8

_SIDE = 128
SPHERES = ("diffuse", "silver", "mirror")


def light_picture(radiance: Float[np.ndarray, "H 2*H 3"] | None) -> UInt8[np.ndarray, "128 640 3"]:
    """The map, then SPHERES, through the mean camera curve at the clip's exposure; black where there is no light."""
    if radiance is None:
        return np.zeros((_SIDE, (2 + len(SPHERES)) * _SIDE, 3), np.uint8)
    shown = resize(reduced(np.asarray(radiance, np.float32), _SIDE), 2 * _SIDE, _SIDE)
    spheres = sphere_images(radiance, _SIDE)
    return to_bytes(response(np.concatenate([shown, *(spheres[name] for name in SPHERES)], axis=1)))
