"""A saved map on its way to an export: what the .json beside it says of its light, and how the map lies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.frames import is_rotation, rotation_of
from anyprobe.errors import InputError
from anyprobe.estimate.ground import Ground, levelled
from anyprobe.estimate.sidecar import FRAME, error_stated, sources_stated
from anyprobe.export.exported_light import map_from_camera, origin_of, origin_turned, sidecar_beside
from anyprobe.inputs.description import numbers_in


def read_rotation(text: str | None) -> np.ndarray | None:
    """Convert YAW,ELEVATION[,ROLL] in degrees, or nine numbers row by row, to world_from_camera [3, 3]; None stays."""
    if text is None:
        return None
    if numbers := numbers_in(text, 2, 3, 9):
        return rotation_of(numbers)
    raise InputError(
        f"expected YAW,ELEVATION[,ROLL] in degrees or nine numbers, got {text[:60]!r}; "
        "for instance 0,20 for a camera that looks 20 degrees down",
        subject="world_from_camera",
    )


def export_settings(path: Path, world_from_camera: np.ndarray | None, *, is_level: bool) -> dict[str, Any]:
    """Return world_from_camera, origin and error_deg of a saved map's export, see export.targets.export.

    Args:
        world_from_camera: [3, 3] rotation that is asked for; None: see is_level.
        is_level: whether the map is turned level, as far as the camera's pitch and roll are stated beside it.
    Raises:
        InputError: the .json beside it is damaged.
    """
    said, turned = sidecar_beside(path), map_from_camera(path)
    origin = origin_of(said) | origin_turned(turned)
    try:
        ground = Ground.of(said.get("ground"))
        if world_from_camera is None and (ground is not None or said.get("frame") == FRAME):
            world_from_camera, level = levelled(ground, turned, is_wanted=is_level)
            if world_from_camera is not None and not is_rotation(world_from_camera):
                raise ValueError("an angle is not finite")
            origin |= level
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"expected the ground in the .json beside {path.name} as it was written, got another; save the "
            "light again, or move the .json away",
            source=path.with_suffix(".json"),
        ) from error
    stated = {"error_deg": error_stated(said), "said_sources": sources_stated(said)}
    return {"world_from_camera": world_from_camera, "origin": origin, **stated}
