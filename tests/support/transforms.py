"""A transforms.json, as trackers write it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np


def transforms(turns: Sequence[Any], names: Iterable[str] | None = None, **common: Any) -> str:
    """Return its text: rotations [3, 3] or matrices [4, 4] of photos of these names, by default 0.png, 1.png, ..."""
    frames = []
    for turn, name in zip(turns, names or (f"{k}.png" for k in range(len(turns))), strict=True):
        pose = np.eye(4)
        pose[: len(turn), : len(turn)] = turn
        frames.append({"file_path": f"images/{name}", "transform_matrix": pose.tolist()})
    return json.dumps({"frames": frames, **common})
