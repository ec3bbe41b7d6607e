"""A contact sheet: each photo with its true mask and those found, edges drawn, to be looked at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from anyprobe.core.color import to_bytes
from anyprobe.estimate.sheet import draw_overlay
from anyprobe.files.atomic import atomic_path
from research.masks.cases import Case
from research.masks.scoring import PROMPTS, Row

TILE, CAPTION, BLOCKS = 180, 14, 2
"""Pixels of a picture's side and of its caption; photos side by side."""


def draw_sheet(path: Path, cases: list[Case], rows: list[Row]) -> None:
    """Write a picture with four tiles a photo: the truth, and what each prompt found; IoU in red with a warning."""
    width = (1 + len(PROMPTS)) * TILE
    lines = -(-len(cases) // BLOCKS)
    sheet = Image.new("RGB", (BLOCKS * width, lines * (TILE + CAPTION)), "white")
    for number, case in enumerate(cases):
        left, top = number % BLOCKS * width, number // BLOCKS * (TILE + CAPTION)
        _put(sheet, left, top, draw_overlay(case.rgb, case.mask), case.group[:28], "black")
        for column, prompt in enumerate(PROMPTS, start=1):
            row = next(one for one in rows if (one.name, one.prompt) == (case.name, prompt))
            mask = np.zeros(case.mask.shape, np.float32) if row.mask is None else row.mask
            picture = draw_overlay(case.rgb, mask, [case.click] if prompt == "click" else [])
            expected = "none" if row.expected is None else f"expected {row.expected:.2f}"
            color = "red" if row.warning else "black"
            _put(sheet, left + column * TILE, top, picture, f"{prompt} {row.iou:.2f}, {expected}", color)
    with atomic_path(path) as temporary:
        sheet.save(temporary, "JPEG", quality=88)


def _put(sheet: Image.Image, left: int, top: int, picture: np.ndarray, caption: str, color: str) -> None:
    tile = Image.fromarray(to_bytes(picture))
    tile.thumbnail((TILE - 4, TILE - 4))
    sheet.paste(tile, (left, top + CAPTION))
    ImageDraw.Draw(sheet).text((left + 2, top + 1), caption, fill=color)
