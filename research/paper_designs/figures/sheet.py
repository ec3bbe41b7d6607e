"""Pictures in rows with titles and captions, and bars."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from anyprobe.core.color import to_bytes
from anyprobe.files.atomic import atomic_path

TILE, GAP, LINE = 112, 4, 15
"""Height of a picture, space between two, height of a line of text [px]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Tile:
    """picture: display values [h, w, 3]; caption: below it; corner: in its upper right corner."""

    picture: np.ndarray
    caption: str = ""
    corner: str = ""


def sheet(titles: list[str], rows: list[list[Tile]]) -> Image.Image:
    """Rows of tiles below the titles of their columns; every column is as wide as its widest tile."""
    widths = [
        max([_width(row[k].picture) for row in rows if k < len(row)] + [6 * len(title) + 4])
        for k, title in enumerate(titles)
    ]
    lefts = np.cumsum([0, *(width + GAP for width in widths)])
    step = TILE + LINE
    page = Image.new("RGB", (int(lefts[-1]), LINE + step * len(rows)), "white")
    pen = ImageDraw.Draw(page)
    for left, title in zip(lefts, titles, strict=False):
        pen.text((left + 2, 1), title, "black")
    for number, row in enumerate(rows):
        top = LINE + step * number
        for left, tile in zip(lefts, row, strict=False):
            shown = Image.fromarray(to_bytes(tile.picture.clip(0, 1)))
            page.paste(shown.resize((_width(tile.picture), TILE), Image.Resampling.BICUBIC), (int(left), top))
            if tile.corner:
                right = int(left) + _width(tile.picture)
                pen.rectangle((right - 6 * len(tile.corner) - 4, top, right, top + LINE - 2), "white")
                pen.text((right - 6 * len(tile.corner) - 2, top + 1), tile.corner, "black")
            pen.text((left + 2, top + TILE + 1), tile.caption, "black")
    return page


def bars(panels: dict[str, dict[str, dict[str, float]]], colors: dict[str, str], digits: dict[str, int]) -> Image.Image:
    """A panel a figure; in it groups of bars, one bar a method: {panel: {group: {method: value}}}."""
    bar, high, across = 26, 150, 0
    parts = []
    for title, groups in panels.items():
        most = max(value for group in groups.values() for value in group.values()) or 1.0
        width = 20 + sum(bar * len(group) + 24 for group in groups.values())
        part = Image.new("RGB", (max(width, 7 * len(title)), high + 3 * LINE), "white")
        pen, left = ImageDraw.Draw(part), 12
        pen.text((4, 1), title, "black")
        for group, values in groups.items():
            for number, (method, value) in enumerate(values.items()):
                x, top = left + bar * number, LINE * 2 + round(high * (1 - value / most))
                pen.rectangle((x, top, x + bar - 3, LINE * 2 + high), colors[method])
                pen.text((x - 2, top - 12), f"{value:.{digits[title]}f}".removeprefix("0"), "black")
            pen.text((left, LINE * 2 + high + 2), group, "black")
            left += bar * len(values) + 24
        parts.append(part)
        across += part.width
    page = Image.new("RGB", (across, high + 4 * LINE), "white")
    pen, left = ImageDraw.Draw(page), 0
    for part in parts:
        page.paste(part, (left, 0))
        left += part.width
    left = 12
    for method, color in colors.items():
        pen.rectangle((left, page.height - 12, left + 9, page.height - 3), color)
        pen.text((left + 13, page.height - 14), method, "black")
        left += 7 * len(method) + 30
    return page


def save(page: Image.Image, path: Path) -> None:
    """A JPEG of photos, or a PNG of few colours, by the name; whole or not at all."""
    with atomic_path(path) as temporary:
        if path.suffix == ".png":
            page.quantize(64).save(temporary, "PNG", optimize=True)
        else:
            page.save(temporary, "JPEG", quality=88, optimize=True)


def _width(picture: np.ndarray) -> int:
    return max(1, round(picture.shape[1] * TILE / picture.shape[0]))
