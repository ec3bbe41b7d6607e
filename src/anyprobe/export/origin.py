"""Where a map on disk comes from: its own header and the .json beside it; maps made for other programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.frames import is_rotation
from anyprobe.errors import InputError
from anyprobe.export.frames import FRONT
from anyprobe.export.light import numbers, origin_of
from anyprobe.files.radiance import map_attributes

MAP_FROM_CAMERA = "map_from_camera"
"""Key of the rotation [3, 3] from the camera's frame to a map's that was turned since the estimate."""


def origin_beside(path: Path) -> dict[str, Any]:
    """What the .json beside a map says of its photo and model, and how the map was turned; nothing if unknown."""
    return origin_of(said_beside(path)) | origin_turned(map_from_camera(path))


def origin_turned(turn: np.ndarray) -> dict[str, Any]:
    """What an export's origin says of a map that was turned by [3, 3] since the estimate; nothing if it was not."""
    return {} if np.allclose(turn, np.eye(3)) else {MAP_FROM_CAMERA: numbers(turn)}


def check_front(path: Path) -> None:
    """Refuse a map that was exported for a program whose maps have another centre than the front.

    Its header says so, of an older .hdr the .json beside it. A map that nothing is known of passes.

    Raises:
        InputError: the map would be a quarter or half turn off.
    """
    wanted = f"{path}: expected a map with the front in its centre"
    advice = "take the file that estimate wrote"
    frame = map_attributes(path).get("frame", "")
    if f"u = {FRONT.u}" in frame:
        return
    said = said_beside(path)
    turned = said.get("map")
    if isinstance(turned, Mapping) and turned.get("rolled_quarters_right"):
        raise InputError(f"{wanted}, got one exported for {said.get('target')}; {advice}")
    if "u = " in frame:
        raise InputError(f"{wanted}, got one with {frame[frame.index('u = ') :]}; {advice}")


def map_from_camera(path: Path) -> np.ndarray:
    """The rotation [3, 3] from the photo's camera to the frame of a map, by its header, of an older .hdr by the .json.

    Raises:
        InputError: what is said is no rotation.
    """
    header = map_attributes(path)
    told = (header if "frame" in header else said_beside(path)).get(MAP_FROM_CAMERA)
    if told is None:
        return np.eye(3)
    try:
        turn = np.array(json.loads(told) if isinstance(told, str) else told, dtype=np.float64)
    except (TypeError, ValueError, OverflowError, RecursionError):
        turn = np.zeros(0)
    if not is_rotation(turn):
        raise InputError(
            f"{path}: expected {MAP_FROM_CAMERA} to be a rotation, got {' '.join(str(told).split())[:120]}; "
            "save the light again"
        )
    return turn


def float_where_long(digits: str) -> int | float:
    """A whole number of JSON; one that no float holds is infinite, and refused where it is used."""
    return int(digits) if len(digits) < 19 else float(digits)


def said_beside(path: Path) -> dict[str, Any]:
    """The .json that an estimate or an export wrote beside a map; {} where there is none of ours."""
    own, other = (path.with_name(f"{stem}.json") for stem in (path.stem, path.stem.removesuffix("_ambient")))
    beside = own if own.is_file() else other
    try:
        said = json.loads(beside.read_text(encoding="utf-8"), parse_int=float_where_long)
    except (OSError, ValueError, RecursionError):  # not ours: the map itself is all that is needed
        return {}
    return said if isinstance(said, dict) else {}
