"""Pictures in rows with titles and captions, and bars."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from anyprobe.core.color import to_bytes
from anyprobe.files.atomic import atomic_path

TILE, GAP, LINE = 128, 6, 18
"""Height of a picture, space between two, height of a line of text [px]."""
FONT = ImageFont.load_default(13)


@dataclass(frozen=True, kw_only=True, slots=True)
class Tile:
    """picture: display values [h, w, 3]; caption: below it; corner: in its upper right corner."""

    picture: np.ndarray
    caption: str = ""
    corner: str = ""


def sheet(titles: list[str], rows: list[list[Tile]], note: str = "") -> Image.Image:
    """Rows of tiles below the titles of their columns, above a note; each column is as wide as what it holds."""
    widths = []
    for k, title in enumerate(titles):
        column = [row[k] for row in rows if k < len(row)]
        texts = [title, *(tile.caption for tile in column)]
        widths.append(max(_width(tile.picture) for tile in column))
        widths[k] = max(widths[k], *(text_width(text) + 2 for text in texts))
    lefts = np.cumsum([0, *(width + GAP for width in widths)])
    step = TILE + LINE
    lines = wrapped(note, int(lefts[-1]) - 4)
    page = Image.new("RGB", (int(lefts[-1]), LINE + step * len(rows) + LINE * len(lines)), "white")
    pen = ImageDraw.Draw(page)
    for left, title in zip(lefts, titles, strict=False):
        pen.text((left + 2, 1), title, "black", FONT)
    for number, row in enumerate(rows):
        top = LINE + step * number
        for left, tile in zip(lefts, row, strict=False):
            shown = Image.fromarray(to_bytes(tile.picture.clip(0, 1)))
            page.paste(shown.resize((_width(tile.picture), TILE), Image.Resampling.BICUBIC), (int(left), top))
            if tile.corner:
                right, wide = int(left) + _width(tile.picture), text_width(tile.corner)
                pen.rectangle((right - wide - 5, top, right, top + LINE - 2), "white")
                pen.text((right - wide - 2, top), tile.corner, "black", FONT)
            pen.text((left + 2, top + TILE + 1), tile.caption, "black", FONT)
    write_lines(pen, lines, LINE + step * len(rows))
    return page


def bars(
    panels: dict[str, dict[str, dict[str, float]]], colors: dict[str, str], digits: dict[str, int], note: str = ""
) -> Image.Image:
    """A panel a figure; in it groups of bars, one bar a method: {panel: {group: {method: value}}}; a note below."""
    bar, high, between = 36, 150, 30
    parts = []
    for title, groups in panels.items():
        most = max(value for group in groups.values() for value in group.values()) or 1.0
        width = 20 + sum(bar * len(group) + between for group in groups.values())
        part = Image.new("RGB", (max(width, text_width(title) + 16), high + 3 * LINE), "white")
        pen, left = ImageDraw.Draw(part), 14
        pen.text((4, 1), title, "black", FONT)
        for group, values in groups.items():
            for number, (method, value) in enumerate(values.items()):
                x, top = left + bar * number, LINE * 2 + round(high * (1 - value / most))
                pen.rectangle((x, top, x + bar - 5, LINE * 2 + high), colors[method])
                pen.text((x, top - LINE + 2), f"{value:.{digits[title]}f}".removeprefix("0"), "black", FONT)
            pen.text((left, LINE * 2 + high + 1), group, "black", FONT)
            left += bar * len(values) + between
        parts.append(part)
    across = sum(part.width for part in parts)
    lines = wrapped(note, across - 4)
    page = Image.new("RGB", (across, high + LINE * (5 + len(lines))), "white")
    pen, left = ImageDraw.Draw(page), 0
    for part in parts:
        page.paste(part, (left, 0))
        left += part.width
    left, legend = 14, high + 3 * LINE + 10
    for method, color in colors.items():
        pen.rectangle((left, legend + 2, left + 11, legend + 13), color)
        pen.text((left + 16, legend), method, "black", FONT)
        left += text_width(method) + 40
    write_lines(pen, lines, high + 5 * LINE)
    return page


def text_width(text: str) -> int:
    """Width of a line in FONT [px]."""
    return math.ceil(FONT.getlength(text))


def wrapped(note: str, width: int) -> list[str]:
    """The lines of a note that is at most `width` pixels wide; a word that is wider has a line of its own."""
    lines: list[str] = []
    for word in note.split():
        if lines and text_width(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def write_lines(pen: ImageDraw.ImageDraw, lines: list[str], top: int) -> None:
    """Write lines of a note below one another."""
    for number, line in enumerate(lines):
        pen.text((2, top + LINE * number), line, "black", FONT)


def save(page: Image.Image, path: Path) -> None:
    """A JPEG of photos, or a PNG of few colours, by the name; whole or not at all."""
    with atomic_path(path) as temporary:
        if path.suffix == ".png":
            page.quantize(64).save(temporary, "PNG", optimize=True)
        else:
            page.save(temporary, "JPEG", quality=88, optimize=True)


def _width(picture: np.ndarray) -> int:
    return max(1, round(picture.shape[1] * TILE / picture.shape[0]))
