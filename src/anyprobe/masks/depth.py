"""The paper's way to cut the object out: keep what a depth sensor saw between a near and a far plane (its Sect. 3)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.errors import InvalidMask
from anyprobe.files.images import MAX_PIXELS
from anyprobe.files.plain_path import utf8_path
from anyprobe.masks.check import check_mask

DepthSource = str | os.PathLike[str] | np.ndarray

Window = tuple[np.ndarray, np.ndarray]
"""x, y of an .exr's first pixel, and x, y just after its last."""

ASPECT_TOLERANCE = 0.02
"""Relative difference of the sides' ratios above which depth and photo are not the same view."""

EXR_CHANNELS = ("Z", "V", "Y", "R")
"""Where an .exr may keep its depth, in this order."""


def read_depth(source: DepthSource) -> np.ndarray:
    """A depth image as float32 [H, W] in its own unit; zero and NaN mean that nothing was measured.

    Args:
        source: an array [H, W], a .npy, a one-channel PNG or TIFF of 8, 16 or 32 bits
            (sensors write millimetres), or an .exr with a channel Z, V, Y or R: of it the display
            window, zero where it holds no data.
    Raises:
        InvalidMask: not a depth image.
    """
    if isinstance(source, np.ndarray):
        values, name = source, "depth"
    else:
        path = Path(source)
        name = path.name
        if not path.is_file():
            raise InvalidMask(f"{path}: expected a depth image, got no such file; check the path")
        readers = {".exr": _read_exr, ".npy": _read_npy}
        try:
            values = readers.get(path.suffix.lower(), _read_picture)(path)
        except InvalidMask:
            raise
        except Exception as error:  # decoders raise whatever the bad bytes lead them to
            raise InvalidMask(
                f"{name}: expected a depth image (16-bit PNG, TIFF, EXR, .npy), got something else; export it again"
            ) from error
    values = np.asarray(values)
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim != 2 or values.size == 0 or values.dtype.kind not in "uif":
        raise InvalidMask(
            f"{name}: expected one depth a pixel, [height, width], got {values.dtype} of shape {values.shape}; "
            "export the depth itself, not a coloured picture of it"
        )
    return values.astype(np.float32)


def mask_from_depth(
    source: DepthSource, shape: tuple[int, int], near: float | None = None, far: float | None = None
) -> np.ndarray:
    """What lies from near to far, both included, in the depth image's own unit.

    A depth image of another size but the same view is read at the nearest pixel.

    Args:
        source: see read_depth.
        shape: (height, width) of the upright photo.
        near, far: at least one; without near everything measured up to far, without far
            everything from near on.
    """
    if near is None and far is None:
        raise InvalidMask(
            "depth: expected where to cut, got neither near nor far; pass --near and --far in the depth image's unit"
        )
    low, high = 0.0 if near is None else float(near), np.inf if far is None else float(far)
    if not 0.0 <= low < high:
        raise InvalidMask(f"depth: expected 0 <= near < far, got near {low:g} and far {high:g}")
    depth = read_depth(source)
    height, width = shape
    if abs(depth.shape[1] / depth.shape[0] / (width / height) - 1.0) > ASPECT_TOLERANCE:
        raise InvalidMask(
            f"depth: expected the photo's view, {width} x {height} or that shape smaller, "
            f"got {depth.shape[1]} x {depth.shape[0]}; crop both alike"
        )
    rows = (np.arange(height) + 0.5) * depth.shape[0] / height
    columns = (np.arange(width) + 0.5) * depth.shape[1] / width
    depth = depth[np.ix_(rows.astype(int), columns.astype(int))]
    measured = np.isfinite(depth) & (depth > 0)
    inside = measured & (depth >= low) & (depth <= high)
    if not inside.any():
        if not measured.any():
            raise InvalidMask("depth: expected measured depths, got none above zero; check the file")
        raise InvalidMask(
            f"depth: expected something from {low:g} to {high:g}, found none; the image holds "
            f"{depth[measured].min():g} to {depth[measured].max():g}"
        )
    return check_mask(inside.astype(np.float32))


def _read_picture(path: Path) -> np.ndarray:
    with Image.open(path, formats=["PNG", "TIFF", "PPM"]) as image:
        if image.width * image.height > MAX_PIXELS:
            raise InvalidMask(f"{path.name}: expected at most {MAX_PIXELS // 1_000_000} million pixels")
        return np.asarray(image)


def _read_npy(path: Path) -> np.ndarray:
    return np.load(path, allow_pickle=False)


def _read_exr(path: Path) -> np.ndarray:
    import OpenEXR

    with utf8_path(path) as plain, OpenEXR.File(plain, header_only=True) as file:
        display, data = (_window(file.header()[name]) for name in ("displayWindow", "dataWindow"))
    width, height = max((high - low for low, high in (display, data)), key=np.prod).tolist()
    if width * height > MAX_PIXELS:
        raise InvalidMask(
            f"{path.name}: expected at most {MAX_PIXELS // 1_000_000} million pixels, "
            f"got {width} x {height}; shrink it first"
        )
    with utf8_path(path) as plain, OpenEXR.File(plain, separate_channels=True) as file:
        channels = {name.split(".")[-1]: channel.pixels for name, channel in file.channels().items()}
    for name in EXR_CHANNELS:
        if name in channels:
            return _shown(channels[name], data, display)
    raise InvalidMask(
        f"{path.name}: expected a channel Z, V, Y or R, got {', '.join(sorted(channels)) or 'none'}"
    )


def _window(corners: Iterable[Sequence[int]]) -> Window:
    low, high = (np.asarray(corner, dtype=np.int64) for corner in corners)
    return low, high + 1


def _shown(pixels: np.ndarray, data: Window, display: Window) -> np.ndarray:
    """The data window's pixels in the display window [H, W]: overscan is cut, zero where there is no data."""
    (data_low, data_high), (low, high) = data, display
    if (data_low == low).all() and (data_high == high).all():
        return pixels
    if pixels.shape != tuple(data_high - data_low)[::-1]:
        raise ValueError("a channel of fewer pixels than its window")
    shown = np.zeros(tuple(high - low)[::-1], dtype=pixels.dtype)
    (x0, y0), (x1, y1) = np.maximum(low, data_low), np.minimum(high, data_high)
    if x1 > x0 and y1 > y0:
        inside = pixels[y0 - data_low[1] : y1 - data_low[1], x0 - data_low[0] : x1 - data_low[0]]
        shown[y0 - low[1] : y1 - low[1], x0 - low[0] : x1 - low[0]] = inside
    return shown
