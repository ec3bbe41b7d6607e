"""Depth images, and the paper's mask from them: depths between a near and a far plane (Sect. 3)."""

import io
import os
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image

from anyprobe.errors import InvalidMask
from anyprobe.files.paths import open_regular
from anyprobe.maps.exr import EXR_MAGIC, in_display, open_exr, read_channel
from anyprobe.maps.image_io import ImageInput
from anyprobe.masks.check import check_mask
from anyprobe.pictures.headers import MAX_PIXELS

DepthSource = str | os.PathLike[str] | bytes | np.ndarray

ASPECT_TOLERANCE = 0.02
"""Largest relative difference between the aspect ratios of a depth image and a photo of the same view."""

NPY_MAGIC = b"\x93NUMPY"
EXR_CHANNELS = ("Z", "V", "Y", "R")
"""Channels of an .exr that may hold depth, in order of preference."""


def read_depth(source: DepthSource) -> np.ndarray:
    """Read a depth image as float32 [H, W] in its own unit; zero and NaN mean that nothing was measured.

    Args:
        source: an array [H, W], a .npy, a one-channel PNG or TIFF of 8, 16 or 32 bits (sensors write millimetres), or
            an .exr with a channel Z, V, Y or R, read over its display window, zero outside its data; files as a path
            or as their bytes.
    Raises:
        InvalidMask: not a depth image.
    """
    if isinstance(source, np.ndarray):
        values, name = source, "depth"
    else:
        name = "depth" if isinstance(source, bytes) else Path(source).name
        try:
            with io.BytesIO(source) if isinstance(source, bytes) else open_regular(source, InvalidMask) as stream:
                values = _decoded(stream, name)
        except InvalidMask as error:
            raise InvalidMask(error, subject="depth") from error
    values = np.asarray(values)
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim != 2 or values.size == 0 or values.dtype.kind not in "uif":
        raise InvalidMask(
            f"expected one depth per pixel, [height, width], got {values.dtype} of shape {values.shape}; "
            "export the depth itself, not a coloured picture of it",
            subject="depth",
            source=name,
        )
    return values.astype(np.float32)


def depth_of_view(source: DepthSource, shape: tuple[int, int]) -> np.ndarray:
    """Read a photo's depth image at its own size; InvalidMask if its aspect ratio is not the photo's [H, W]."""
    depth = read_depth(source)
    height, width = shape
    if abs(depth.shape[1] / depth.shape[0] / (width / height) - 1.0) > ASPECT_TOLERANCE:
        raise InvalidMask(
            f"expected the photo's view, {width} x {height} or smaller at that aspect ratio, "
            f"got {depth.shape[1]} x {depth.shape[0]}; crop both alike",
            subject="depth",
        )
    return depth


def mask_from_depth(
    source: DepthSource, shape: tuple[int, int], near: float | None = None, far: float | None = None
) -> np.ndarray:
    """Return the mask of the depths from near to far, both included, in the depth image's own unit.

    A depth image of another size is sampled at the nearest pixel.

    Args:
        source: see read_depth.
        shape: (height, width) of the upright photo.
        near, far: None: no bound on that side.
    """
    low, high = 0.0 if near is None else float(near), np.inf if far is None else float(far)
    if not 0.0 <= low < high:
        raise InvalidMask(f"expected 0 <= near < far, got {low:g} and {high:g}", subject=("near", "far"))
    depth = depth_of_view(source, shape)
    height, width = shape
    rows = (np.arange(height) + 0.5) * depth.shape[0] / height
    columns = (np.arange(width) + 0.5) * depth.shape[1] / width
    depth = depth[np.ix_(rows.astype(int), columns.astype(int))]
    measured = np.isfinite(depth) & (depth > 0)
    inside = measured & (depth >= low) & (depth <= high)
    if not inside.any():
        if not measured.any():
            raise InvalidMask("expected measured depths, got none above zero; check the file", subject="depth")
        raise InvalidMask(
            f"expected depths from {low:g} to {high:g}, got none there; the image has "
            f"{depth[measured].min():g} to {depth[measured].max():g}",
            subject="depth",
        )
    return check_mask(inside.astype(np.float32))


def _decoded(stream: BinaryIO, name: str) -> np.ndarray:
    """Decode an open file, whose first bytes decide how."""
    start = stream.read(len(NPY_MAGIC))
    stream.seek(0)
    try:
        if start.startswith(EXR_MAGIC):
            return _read_exr(stream, name)
        return np.load(stream, allow_pickle=False) if start == NPY_MAGIC else _read_picture(stream, name)
    except InvalidMask:
        raise
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        text = "expected a depth image (16-bit PNG, TIFF, EXR, .npy), got something else; export it again"
        raise InvalidMask(text, source=name) from error


def _read_picture(stream: BinaryIO, name: str) -> np.ndarray:
    with Image.open(stream, formats=["PNG", "TIFF"]) as image:
        if image.width * image.height > MAX_PIXELS:
            raise InvalidMask(
                f"expected at most {MAX_PIXELS // 1_000_000} million pixels, "
                f"got {image.width} x {image.height}; shrink it",
                source=name,
            )
        if image.mode != "P":
            return np.asarray(image)
        values = np.asarray(image.convert("RGB"))
        if np.ptp(values, axis=-1).any():
            raise InvalidMask("expected depth, got a coloured picture of it; save the depth itself", source=name)
        return values[..., 0]


def _read_exr(stream: BinaryIO, name: str) -> np.ndarray:
    with open_exr(stream, name, InvalidMask, MAX_PIXELS) as image:
        found = image.spec().channelnames
        names = sorted((key for key in found if not _is_of_color(key, image)), key=lambda key: "depth" in key.lower())
        channels = {key.split(".")[-1]: key for key in names}  # the layer whose name has depth in it wins
        if (chosen := next((channels[one] for one in EXR_CHANNELS if one in channels), None)) is not None:
            return in_display(read_channel(image, chosen), image.spec())
    raise InvalidMask(f"expected a channel Z, V, Y or R, got {', '.join(sorted(found)) or 'none'}", source=name)


def _is_of_color(key: str, image: ImageInput) -> bool:
    """Return whether a channel belongs to a vector X, Y, Z, or to a colour with differing R, G and B."""
    layer, _, channel = key.rpartition(".")
    group = [f"{layer}.{part}" if layer else part for part in ("XYZ" if channel in "XYZ" else "RGB")]
    if channel not in "XYZRGB" or not all(name in image.spec().channelnames for name in group):
        return False
    first, *others = (read_channel(image, name) for name in group)
    return channel in "XYZ" or not all(np.array_equal(first, other, equal_nan=True) for other in others)
