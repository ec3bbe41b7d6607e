"""Masks of photos by the page's own code, in Node, with the page's runtime."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.masks.networks import default_graph
from anyprobe.masks.weights import find_weights

WEB = Path(__file__).parents[2] / "web"


def can_run() -> bool:
    """Whether Node.js and the packages of web/ (cd web && npm ci) are there."""
    return shutil.which("node") is not None and (WEB / "node_modules" / "onnxruntime-web").is_dir()


def page_masks(
    folder: Path,
    photos: Sequence[np.ndarray],
    clicks: Sequence[Sequence[tuple[float, float]]],
    boxes: Sequence[Sequence[float] | None] | None = None,
) -> tuple[list[np.ndarray], list[float]]:
    """Mask [H, W] of each photo [H, W, 3] in [0, 1] told its clicks x, y on the object or its box, and what it took.

    Args:
        folder: an empty one, for the photos and masks.
        boxes: x0, y0, x1, y1 around the object of each photo, or None.
    Returns:
        The masks, by U2-Net-p where its weights are, and of each the milliseconds of processor time.
    """
    cases = []
    for number, (rgb, on, box) in enumerate(zip(photos, clicks, boxes or [None] * len(photos), strict=True)):
        height, width = rgb.shape[:2]
        opaque = np.full((height, width, 1), 255, np.uint8)
        (folder / f"{number}.rgba").write_bytes(np.concatenate([to_bytes(rgb), opaque], axis=-1).tobytes())
        told = {
            "on": [[float(x), float(y)] for x, y in on],
            "off": [],
            "box": None if box is None else [float(value) for value in box],
        }
        cases.append({"name": str(number), "width": width, "height": height, "hints": told})
    found = find_weights()
    weights = {"mask": str(default_graph())} if found is None else {"u2netp": str(found.path)}
    (folder / "cases.json").write_text(json.dumps({"weights": weights, "cases": cases}))
    run = subprocess.run(["node", "bench/masks.js", str(folder)], cwd=WEB, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise RuntimeError(run.stderr[-2000:])
    spent = json.loads(run.stdout)
    masks = [np.fromfile(folder / f"{number}.f32", "<f4").reshape(rgb.shape[:2]) for number, rgb in enumerate(photos)]
    return masks, [spent[case["name"]] for case in cases]
