"""Pictures that hold linear radiance, of any shape: .exr and .hdr."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError
from anyprobe.files.images import EXR_MAGIC, MAX_PIXELS, ImageSource, exr_file
from anyprobe.files.radiance import HDR_MAGIC, decode_hdr, read_exr


def read_linear(source: ImageSource) -> np.ndarray | None:
    """The radiance of an .exr or .hdr, known by its first bytes; None for any other source.

    Returns:
        [H, W, 4] float32: linear Rec. 709 >= 0 times cover, and cover in [0, 1], 1 where the file has no A.
    Raises:
        InputError: damaged, too large, NaN.
    """
    if isinstance(source, str | os.PathLike):
        name = Path(source).name
        try:
            with Path(source).open("rb") as stream:
                data = stream.read(len(EXR_MAGIC))
                if data == EXR_MAGIC or data.startswith(HDR_MAGIC):
                    data += stream.read()
        except (OSError, ValueError):  # read_image says what is wrong
            return None
    elif isinstance(source, bytes):
        data, name = source, "bytes"
    else:
        return None
    if data.startswith(EXR_MAGIC):
        with exr_file(data) as path:
            pixels = read_exr(path, name, InputError, MAX_PIXELS, rec709=True)
    elif data.startswith(HDR_MAGIC):
        pixels = decode_hdr(data, name, MAX_PIXELS)
    else:
        return None
    if not np.isfinite(pixels).all():
        raise InputError(f"{name}: expected finite radiance, got NaN or infinity; repair the picture first")
    cover = np.clip(pixels[..., 3:], 0.0, 1.0) if pixels.shape[2] == 4 else np.ones_like(pixels[..., :1])
    return np.concatenate([np.maximum(pixels[..., :3], 0.0) * (cover > 0), cover], axis=-1)
