"""Where a map on disk comes from: the .json beside it and its own header; maps made for other programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from anyprobe.errors import InputError
from anyprobe.export.frames import FRONT
from anyprobe.export.light import origin_of
from anyprobe.files.radiance import exr_attributes


def origin_beside(path: Path) -> dict[str, Any]:
    """What the .json beside a map says of its photo and model; nothing where there is none."""
    return origin_of(_said_beside(path))


def check_front(path: Path) -> None:
    """Refuse a map that was exported for a program whose maps have another centre than the front.

    An .exr says so in its header, anything else in the .json beside it. A map that nothing is known of passes.

    Raises:
        InputError: the map would be a quarter or half turn off.
    """
    wanted = f"{path}: expected a map with the front in its centre"
    advice = "take the file that estimate wrote"
    frame = exr_attributes(path).get("frame", "") if path.suffix.lower() == ".exr" else ""
    if f"u = {FRONT.u}" in frame:
        return
    said = _said_beside(path)
    turned = said.get("map")
    if isinstance(turned, Mapping) and turned.get("rolled_quarters_right"):
        raise InputError(f"{wanted}, got one exported for {said.get('target')}; {advice}")
    if "u = " in frame:
        raise InputError(f"{wanted}, got one with {frame[frame.index('u = ') :]}; {advice}")


def _said_beside(path: Path) -> dict[str, Any]:
    """The .json that an estimate or an export wrote beside a map; {} where there is none of ours."""
    beside = path.with_name(f"{path.stem.removesuffix('_ambient')}.json")
    try:
        said = json.loads(beside.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):  # not ours: the map itself is all that is needed
        return {}
    return said if isinstance(said, dict) else {}
