"""Resizing of pictures of floats with any number of channels."""

from __future__ import annotations

import numpy as np
from PIL import Image


def resample(picture: np.ndarray, size: tuple[int, int], *, smooth: bool = False) -> np.ndarray:
    """Resize [H, W, C] to (width, height), float32: means over areas, or with smooth linear interpolation."""
    way = Image.Resampling.BILINEAR if smooth else Image.Resampling.BOX
    planes = [
        np.asarray(Image.fromarray(np.ascontiguousarray(picture[..., k], np.float32)).resize(size, way))
        for k in range(picture.shape[-1])
    ]
    return np.stack(planes, axis=-1)
