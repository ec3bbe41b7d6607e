"""Sheets of photos of each family, to be looked at: the photo with its mask's outline, and its light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.estimate.sheet import draw_overlay
from anyprobe.files.atomic import atomic_path
from research.scenes.camera import take
from research.scenes.layouts import draw_layout
from research.scenes.parts import store_of
from research.scenes.render import render_layout

ROW, COLUMNS = 220, 4


def draw_sheets(data: Path, out: Path, part: str, families: Sequence[str], count: int) -> Iterator[Path]:
    """Write out/FAMILY.jpg and yield its path, for each family."""
    store = store_of(data, part)
    for family in families:
        tiles = []
        for number in range(count):
            layout = draw_layout(family, part, number, store)
            photo = take(render_layout(layout), layout.phone.long_fov_deg, np.random.default_rng(number))
            shown = draw_overlay(photo.picture / np.float32(255), photo.mask.astype(np.float32))
            tiles.append([shown, response(photo.truth)])
        rows = [tiles[k : k + COLUMNS] for k in range(0, count, COLUMNS)]
        width = max(sum(_width(one) for tile in row for one in tile) for row in rows)
        sheet = Image.new("RGB", (width, ROW * len(rows)))
        for k, row in enumerate(rows):
            left = 0
            for one in (one for tile in row for one in tile):
                picture = Image.fromarray(to_bytes(one)).resize((_width(one), ROW), Image.Resampling.BICUBIC)
                sheet.paste(picture, (left, k * ROW))
                left += _width(one)
        path = out / f"{family}.jpg"
        with atomic_path(path) as temporary:
            sheet.save(temporary, "JPEG", quality=85)
        yield path


def _width(picture: np.ndarray) -> int:
    """Return a tile's width; maps are as high as half a row's."""
    return max(1, round(picture.shape[1] / picture.shape[0] * ROW))
