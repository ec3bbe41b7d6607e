"""Masks of photos and their lights by the page's own code, in Node, with the page's runtime."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.estimate.runtime import weights_folder
from anyprobe.masks.networks import default_graph
from anyprobe.masks.weights import find_weights

WEB = Path(__file__).parents[2] / "web"


def can_run() -> bool:
    """Whether Node.js and the packages of web/ (cd web && npm ci) are there."""
    return shutil.which("node") is not None and (WEB / "node_modules" / "onnxruntime-web").is_dir()


@dataclass(frozen=True, kw_only=True, slots=True)
class PageAnswer:
    """mask [H, W]; ms: processor time that it took; direction, irradiance: of the dominant light, if asked for."""

    mask: np.ndarray
    ms: float
    direction: np.ndarray | None = None
    irradiance: np.ndarray | None = None


def page_masks(
    folder: Path,
    photos: Sequence[np.ndarray],
    clicks: Sequence[Sequence[tuple[float, float]]],
    boxes: Sequence[Sequence[float] | None] | None = None,
    *,
    light: bool = False,
    live: bool = False,
) -> list[PageAnswer]:
    """What the page finds in each photo [H, W, 3] in [0, 1] told its clicks x, y on the object or its box; by U2-Net-p
    where its weights are.

    Args:
        folder: an empty one, for the photos and masks.
        boxes: x0, y0, x1, y1 around the object of each photo, or None.
        light: whether the light of the mask is estimated too, by the shipped graphs.
        live: as in a camera's frame, by one look of the small network.
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
    found = None if live else find_weights()
    weights = {"mask": str(default_graph())} if found is None else {"u2netp": str(found.path)}
    weights |= {"light": str(weights_folder("lift") / "light.onnx")} if light else {}
    (folder / "cases.json").write_text(json.dumps({"weights": weights, "isLive": live, "cases": cases}))
    run = subprocess.run(["node", "bench/masks.js", str(folder)], cwd=WEB, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise RuntimeError(run.stderr[-2000:])
    answers = []
    for number, (said, rgb) in enumerate(zip(json.loads(run.stdout).values(), photos, strict=True)):
        mask = np.fromfile(folder / f"{number}.f32", "<f4").reshape(rgb.shape[:2])
        dominant = {name: np.array(value) for name, value in said.get("dominant", {}).items()}
        answers.append(PageAnswer(mask=mask, ms=said["ms"], **dominant))
    return answers
