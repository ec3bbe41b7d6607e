"""Resizing of pictures, as web/src/photo/resize.js."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image


def resize(picture: np.ndarray, width: int, height: int, box: Sequence[float] | None = None) -> np.ndarray:
    """Resize float32 [H, W] or [H, W, C]: averaged over areas when shrinking, else linear.

    Args:
        box: x0, y0, x1, y1 of the part to resize [px], not necessarily integers; None: the whole picture.
    """
    if picture.ndim == 3:
        return np.stack([resize(picture[..., c], width, height, box) for c in range(picture.shape[2])], axis=-1)
    image = Image.fromarray(np.ascontiguousarray(picture, np.float32))
    part = None if box is None else (box[0], box[1], box[2], box[3])
    return np.asarray(image.resize((width, height), Image.Resampling.BILINEAR, box=part))
