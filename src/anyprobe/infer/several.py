"""Several photos of one object in one place, whose cameras' poses are known: one light of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anyprobe.core.frames import is_rotation
from anyprobe.errors import InputError
from anyprobe.infer.result import Light
from anyprobe.light.fuse import fuse

SURE = 2.0
"""The power of its confidence that a map counts with, pixel by pixel; chosen on assets that no weights learned from."""
LEAST = 1e-4
"""Weight of a pixel of which a map says nothing."""
UNTOLD = (
    "exposure: expected photos that all say theirs (EXIF), got some that do not; taken to be the same for all"
)


def fuse_lights(lights: Sequence[Light], world_from_camera: Sequence[np.ndarray]) -> Light:
    """One light, in the camera's frame and the exposure units of the first photo.

    What the object does not face in one photo it does in another; where all guess, their errors average out. Each
    counts as it is sure of a direction. Photos of other exposures are brought to the first's where all say theirs
    (EXIF); else they must have been taken with one, as with a locked camera.

    Args:
        lights: of an Estimator, one a photo; the light and the object must not have moved between them.
        world_from_camera: [3, 3] each, of the same photos; any world whose axes do not move.
    Raises:
        InputError: no light, not as many poses as lights, or a pose that is no rotation.
    """
    if not lights or len(lights) != len(world_from_camera):
        raise InputError(
            f"poses: expected one a light, got {len(world_from_camera)} for {len(lights)} lights"
        )
    turns = [np.asarray(world_from_camera[0]).T @ pose for pose in world_from_camera]
    for number, pose in enumerate(world_from_camera, start=1):
        if not is_rotation(pose):
            raise InputError(f"poses: expected rotations [3, 3], got another matrix for photo {number}")
    first, told = lights[0], [light.info.get("exposure") for light in lights]
    gains = [told[0] / one for one in told] if all(told) else [1.0] * len(told)
    turned = [first] + [light.rotate(turn) for light, turn in zip(lights[1:], turns[1:], strict=True)]
    maps = np.stack([light.radiance * np.float32(gain) for light, gain in zip(turned, gains, strict=True)])
    sure = np.stack(
        [np.ones(maps.shape[1:3]) if one.confidence is None else one.confidence for one in turned]
    )
    weights = sure**SURE + LEAST
    known = all(light.confidence is not None for light in lights)
    notes = [line for light in lights for line in light.warnings]
    notes += [] if len(lights) == 1 or all(told) else [UNTOLD]
    return replace(
        first,
        radiance=fuse(maps, weights),
        confidence=((weights * sure).sum(axis=0) / weights.sum(axis=0)).astype(np.float32) if known else None,
        told=float(np.mean([light.told for light in lights])),
        warnings=tuple(dict.fromkeys(notes)),
        info={**first.info, "fused": [light.info.get("photo") for light in lights]},
    )
