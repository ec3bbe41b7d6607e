"""Sheets of labelled pictures, as the paper's figures are, and charts of lines; drawn with Pillow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from anyprobe.core.color import to_bytes
from anyprobe.files.atomic import atomic_path

GAP, TOP = 3, 20
COLORS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#7f7f7f", "#17becf")
CHART = (640, 360)
MARGIN = (58, 14, 30, 40)
"""Left, top, right and bottom of a chart [pixels]."""


def draw_sheet(
    columns: Sequence[str],
    rows: Sequence[Sequence[np.ndarray]],
    notes: Sequence[Sequence[str]] | None = None,
    height: int = 64,
) -> Image.Image:
    """Pictures [H, W, 3] in [0, 1] in rows under column names; notes are written into the corners.

    Pictures are brought to one height; those of a column should have one shape.
    """
    font, small = ImageFont.load_default(12), ImageFont.load_default(11)
    tiles = [[_tile(picture, height) for picture in row] for row in rows]
    widths = [max(row[k].width for row in tiles) for k in range(len(columns))]
    full = (sum(widths) + GAP * (len(widths) + 1), TOP + (height + GAP) * len(rows))
    sheet = Image.new("RGB", full, "white")
    draw = ImageDraw.Draw(sheet)
    x = GAP
    for k, (name, width) in enumerate(zip(columns, widths, strict=True)):
        draw.text((x + width / 2, TOP / 2), name, fill="black", font=font, anchor="mm")
        for r, row in enumerate(tiles):
            y = TOP + (height + GAP) * r
            sheet.paste(row[k], (x, y))
            if notes and notes[r][k]:
                box = draw.textbbox((x + width - 2, y + 2), notes[r][k], font=small, anchor="ra")
                draw.rectangle(box, fill="black")
                draw.text((x + width - 2, y + 2), notes[r][k], fill="white", font=small, anchor="ra")
        x += width + GAP
    return sheet


def _tile(picture: np.ndarray, height: int) -> Image.Image:
    image = Image.fromarray(to_bytes(np.clip(picture, 0.0, 1.0)))
    if image.height == height:
        return image
    kind = Image.Resampling.NEAREST if image.height < height else Image.Resampling.BOX
    return image.resize((round(image.width * height / image.height), height), kind)


def heat(radiance: np.ndarray, top: float = 10.0) -> np.ndarray:
    """Mean radiance from 0 to top as black, blue, red, yellow, white (paper Fig. 11): [H, W, 3] display."""
    x = np.clip(radiance.mean(axis=-1) / top, 0.0, 1.0)
    stops = np.array([[0, 0, 0], [0, 0, 0.7], [0.85, 0, 0.2], [1, 0.85, 0], [1, 1, 1]])
    places = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(x, places, stops[:, k]) for k in range(3)], axis=-1).astype(np.float32)


def draw_chart(
    lines: Mapping[str, tuple[Sequence[float], Sequence[float]]], x_name: str, y_name: str
) -> Image.Image:
    """Lines by name, each x and y, with axes from the data's range and a legend."""
    image = Image.new("RGB", CHART, "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(11)
    xs = np.concatenate([np.asarray(x, float) for x, _ in lines.values()])
    ys = np.concatenate([np.asarray(y, float) for _, y in lines.values()])
    low_x, high_x = float(xs.min()), float(max(xs.max(), xs.min() + 1e-9))
    low_y, high_y = float(ys.min()), float(max(ys.max(), ys.min() + 1e-9))
    left, top, right, bottom = MARGIN
    width, height = CHART[0] - left - right, CHART[1] - top - bottom

    def place(x: float, y: float) -> tuple[float, float]:
        return (
            left + width * (x - low_x) / (high_x - low_x),
            top + height * (1 - (y - low_y) / (high_y - low_y)),
        )

    for share in np.linspace(0, 1, 5):
        x, y = low_x + share * (high_x - low_x), low_y + share * (high_y - low_y)
        draw.line([place(low_x, y), place(high_x, y)], fill="#dddddd")
        draw.text((left - 6, place(low_x, y)[1]), f"{y:.3g}", fill="black", font=font, anchor="rm")
        draw.text((place(x, low_y)[0], top + height + 6), f"{x:,.0f}", fill="black", font=font, anchor="mt")
    draw.text((left + width / 2, CHART[1] - 4), x_name, fill="black", font=font, anchor="mb")
    draw.text((left, 1), y_name, fill="black", font=font)
    for k, (name, (x, y)) in enumerate(lines.items()):
        color = COLORS[k % len(COLORS)]
        points = [place(float(a), float(b)) for a, b in zip(x, y, strict=True)]
        if len(points) > 1:
            draw.line(points, fill=color, width=2)
        draw.text((CHART[0] - right - 4, top + 4 + 14 * k), name, fill=color, font=font, anchor="ra")
    return image


def save_chart(path: Path, image: Image.Image) -> None:
    """As a small .png: a chart has few colours."""
    with atomic_path(path) as temporary:
        image.quantize(256, dither=Image.Dither.NONE).save(temporary, format="PNG", optimize=True)


def save_sheet(path: Path, image: Image.Image) -> None:
    """As a .jpg of full colour: what looks like noise or texture in it is in the pictures."""
    with atomic_path(path) as temporary:
        image.save(temporary, format="JPEG", quality=92, subsampling=0, optimize=True)
