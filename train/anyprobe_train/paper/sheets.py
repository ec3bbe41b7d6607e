"""Pictures side by side."""

from collections.abc import Sequence

import numpy as np
import torch
from PIL import Image, ImageDraw

from anyprobe.core.color import luminance

PICTURE_ROWS, GAP, LINE = 128, 4, 14
"""Height of a picture in a sheet, what is between two, and the height of a line of text [pixels]."""
HEAT = np.array([[0, 0, 0], [40, 20, 130], [190, 40, 90], [250, 150, 30], [255, 255, 220]], np.float32) / 255
MOST = 10.0
"""Radiance at the end of heat maps, as in the paper's Fig. 11."""


def heat(radiance: torch.Tensor) -> torch.Tensor:
    """Colour the luminance of maps [N, 3, R, 2 R] from 0 to MOST."""
    value = luminance(radiance.permute(0, 2, 3, 1).numpy()).clip(0, MOST) / MOST
    colors = [np.interp(value, np.linspace(0, 1, len(HEAT)), HEAT[:, channel]) for channel in range(3)]
    return torch.from_numpy(np.stack(colors, axis=1).astype(np.float32))


def as_pictures(pictures: torch.Tensor) -> np.ndarray:
    """Return [N, H, W, C] of [N, C, H, W]."""
    return np.moveaxis(pictures.cpu().numpy(), 1, -1)


def as_bytes(pictures: torch.Tensor) -> np.ndarray:
    """Convert display values [N, 3, H, W] to [N, H, W, 3] uint8."""
    return (pictures.clip(0.0, 1.0).permute(0, 2, 3, 1).numpy() * 255 + 0.5).astype(np.uint8)


def columns_of(*columns: torch.Tensor) -> list[list[np.ndarray]]:
    """Return rows of a sheet from its columns, pictures [N, 3, H, W] each."""
    return [list(row) for row in zip(*map(as_bytes, columns), strict=True)]


def picture_sheet(rows: Sequence[Sequence[np.ndarray]], titles: Sequence[str] = ()) -> Image.Image:
    """Arrange pictures [H, W, 3] uint8, scaled to PICTURE_ROWS pixels high, under the titles of the columns."""
    cells = [[Image.fromarray(np.ascontiguousarray(one)) for one in row] for row in rows]
    cells = [[one.resize((PICTURE_ROWS * one.width // one.height, PICTURE_ROWS)) for one in row] for row in cells]
    width = max(sum(one.width + GAP for one in row) for row in cells)
    head = LINE if titles else 0
    whole = Image.new("RGB", (width, head + len(cells) * (PICTURE_ROWS + GAP)), "white")
    pen = ImageDraw.Draw(whole)
    for top, row in enumerate(cells):
        left = 0
        for column, one in enumerate(row):
            if titles and top == 0:
                pen.text((left, 0), titles[column], fill="black")
            whole.paste(one, (left, head + top * (PICTURE_ROWS + GAP)))
            left += one.width + GAP
    return whole


def with_captions(picture: Image.Image, lines: Sequence[str]) -> Image.Image:
    """Write lines of text under a picture."""
    whole = Image.new("RGB", (picture.width, picture.height + LINE * len(lines)), "white")
    whole.paste(picture, (0, 0))
    for number, line in enumerate(lines):
        ImageDraw.Draw(whole).text((0, picture.height + LINE * number), line, fill="black")
    return whole
