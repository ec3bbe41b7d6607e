"""OpenEXR files: the colours of a picture or map among their parts and channels, and single channels.

OpenImageIO decodes them, by image_io.open_image. Limits cover what is decoded: all channels of the part that is read.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from anyprobe.core.color import (
    REC709_CHROMATICITIES,
    SAME_CHROMATICITIES,
    XYZ_CHROMATICITIES,
    rec709_from_rgb,
    xyz_from_rgb,
)
from anyprobe.errors import InputError
from anyprobe.files.paths import open_regular
from anyprobe.maps.image_io import ImageInput, ImageSpec, encode_image, open_image, read_pixels

EXR_MAGIC = b"\x76\x2f\x31\x01"

MAX_PARTS = 64
"""Number of parts in which colours are looked for."""
MOST_SIDE_PX = 65_535

LEAST_ASPECT, SQUARE = 0.25, 0.01
"""Smallest pixel aspect ratio, and inverse of the largest, that is believed; and how far from 1 it may be."""

WHOLE_LAYERS = ("combined", "beauty", "rgba", "composite")
"""Lower-case names of layers that hold the whole picture, in files of Blender and other renderers."""

WRITTEN_OUT = {"red": "R", "green": "G", "blue": "B", "alpha": "A"}


@contextmanager
def open_exr(source: BinaryIO | bytes, name: str, fault: type[InputError], max_pixels: int) -> Iterator[ImageInput]:
    """Open a flat picture.

    Args:
        fault: class of the error to raise, for errors within the block too.
        max_pixels: largest number of pixels, counted once for every four channels, since all are decoded.
    """
    try:
        with open_image(source, "openexr") as image:
            _check(image.spec(), name, fault, max_pixels)
            yield image
    except (ValueError, MemoryError) as error:
        if isinstance(error, InputError):
            raise
        got = f"a damaged or empty file ({error}); export it again"
        raise fault(f"expected a flat OpenEXR picture, got {got}", source=name) from error


def _check(spec: ImageSpec, name: str, fault: type[InputError], max_pixels: int) -> None:
    if spec.deep:
        raise fault("expected a flat OpenEXR picture, got a deep one; save it flat", source=name)
    aspect = spec.get_float_attribute("PixelAspectRatio", 1.0)
    if LEAST_ASPECT <= aspect <= 1 / LEAST_ASPECT and abs(aspect - 1.0) > SQUARE:
        text = f"expected square pixels, got ones {aspect:g} times as wide as high; resample the picture"
        raise fault(text, source=name)
    width, height, decoded = max(spec.width, spec.full_width), max(spec.height, spec.full_height), exr_pixels(spec)
    if decoded > max_pixels:
        raise fault(
            f"expected at most {max_pixels / 1e6:.0f} million pixels in all layers, "
            f"got {width} x {height} and {decoded / 1e6:.0f} million; shrink it first",
            source=name,
        )
    if max(width, height) > MOST_SIDE_PX:
        text = f"expected sides of at most {MOST_SIDE_PX} pixels, got {width} x {height}; shrink it first"
        raise fault(text, source=name)


def exr_pixels(spec: ImageSpec) -> int:
    """Count the pixels that a part is decoded to, see open_exr."""
    return max(spec.width * spec.height, spec.full_width * spec.full_height) * -(-spec.nchannels // 4)


def exr_attributes(source: BinaryIO | bytes, prefix: str) -> dict[str, str]:
    """Return the text attributes with this prefix, by the rest of their names; empty without a valid header."""
    with suppress(ValueError), open_image(source, "openexr") as image:
        named = ((one.name, one.value) for one in image.spec().extra_attribs if one.name.startswith(prefix))
        return {name.removeprefix(prefix): value for name, value in named if isinstance(value, str)}
    return {}


def read_exr(
    source: str | os.PathLike[str] | bytes, name: str, fault: type[InputError], max_pixels: int, *, rec709: bool = False
) -> np.ndarray:
    """Read the colour of an .exr: R, G, B, or X, Y, Z, or Y, RY, BY, or Y, with A if present; of the first part that
    has them, else those of a layer, LAYER.R.

    A data window smaller than the display window is padded with black.

    Args:
        source: a path, or the file's bytes.
        fault, max_pixels: see open_exr.
        rec709: convert light of other chromaticities, and X, Y, Z, to linear Rec. 709; else return the numbers as
            stored.
    Returns:
        [H, W, 3] or [H, W, 4] float32: colour is premultiplied by A.
    """
    opened = nullcontext(source) if isinstance(source, bytes) else open_regular(source, fault)
    with opened as stream, open_exr(stream, name, fault, max_pixels) as image:
        listed = ", ".join(image.spec().channelnames[:20]) or "none"
        for part in range(MAX_PARTS):
            if not image.seek_subimage(part, 0):
                break
            spec = image.spec()
            if (channels := _color_channels(spec.channelnames)) and not spec.deep:
                _check(spec, name, fault, max_pixels)
                pixels = read_pixels(image, list(channels.values())).astype(np.float32)
                return in_display(_as_rgb("".join(channels), pixels, spec, name, fault, rec709), spec)
    raise fault(f"expected channels R, G, B or Y, got {listed}; save a flat RGB picture", source=name)


def _color_channels(names: Sequence[str]) -> dict[str, int]:
    """Return the channels of a part that are its colours, by letter: those of no layer, else of the layer of
    WHOLE_LAYERS, else of the only layer; empty where none are."""
    layers: dict[str, dict[str, int]] = {}
    for k, name in enumerate(names):
        layer, _, channel = name.rpartition(".")
        channel = WRITTEN_OUT.get(channel.lower(), channel.upper())
        layers.setdefault(layer, {}).setdefault(channel, k)
    plain = _colors_of(layers.pop("", {}), ("RGB", "XYZ", ("Y", "RY", "BY"), "Y"))
    if plain:
        return plain
    pictures = [layer for layer in layers if "crypto" not in layer.lower()]  # Cryptomatte's are numbers
    found = {layer: colors for layer in pictures if (colors := _colors_of(layers[layer], ("RGB",)))}
    whole = [layer for layer in found if layer.rpartition(".")[2].lower() in WHOLE_LAYERS] or list(found)
    return found[whole[0]] if len(whole) == 1 else {}


def _colors_of(channels: Mapping[str, int], kinds: Sequence[Sequence[str]]) -> dict[str, int]:
    for kind in kinds:
        if all(letter in channels for letter in kind):
            return {letter: channels[letter] for letter in (*kind, "A") if letter in channels}
    return {}


def _as_rgb(
    kind: str, pixels: np.ndarray, spec: ImageSpec, name: str, fault: type[InputError], rec709: bool
) -> np.ndarray:
    """Convert channels of a kind, such as XYZ, YRYBY or YA, to R, G, B and perhaps A."""
    color, alpha = (pixels[..., :-1], pixels[..., -1:]) if kind.endswith("A") else (pixels, pixels[..., :0])
    chromaticities = spec.getattribute("chromaticities")
    if kind.startswith("YRYBY"):
        color = _from_chroma(color, chromaticities or REC709_CHROMATICITIES, name, fault)
    if kind.startswith("XYZ"):
        chromaticities = XYZ_CHROMATICITIES
    if rec709 and chromaticities is not None:
        color = to_rec709(color, chromaticities, name, fault, adapts=not _are_xyz(chromaticities))
    return np.concatenate([np.broadcast_to(color, (*color.shape[:2], 3)), alpha], axis=-1)


def _from_chroma(pixels: np.ndarray, chromaticities: Sequence[float], name: str, fault: type[InputError]) -> np.ndarray:
    """Convert luminance and chroma to R, G, B: RY = (R - Y) / Y and BY = (B - Y) / Y.

    The weights of Y follow from the chromaticities.
    """
    weights = _checked(xyz_from_rgb, chromaticities, name, fault)[1]
    y, ry, by = np.moveaxis(pixels, -1, 0)
    r, b = (ry + 1) * y, (by + 1) * y
    return np.stack([r, (y - weights[0] * r - weights[2] * b) / weights[1], b], axis=-1).astype(np.float32)


def read_channel(image: ImageInput, name: str) -> np.ndarray:
    """Read one channel of an open picture [H, W] of its data window, as stored."""
    return read_pixels(image, [image.spec().channelindex(name)])[..., 0]


def in_display(pixels: np.ndarray, spec: ImageSpec) -> np.ndarray:
    """Place pixels [H, W, ...] of the data window in the display window: overscan is cropped, missing data is zero.

    Raises:
        ValueError: they do not overlap.
    """
    x, y = spec.x - spec.full_x, spec.y - spec.full_y
    if (x, y, spec.width, spec.height) == (0, 0, spec.full_width, spec.full_height):
        return pixels
    canvas = np.zeros((spec.full_height, spec.full_width, *pixels.shape[2:]), dtype=pixels.dtype)
    left, top = max(x, 0), max(y, 0)
    right, bottom = min(x + spec.width, spec.full_width), min(y + spec.height, spec.full_height)
    if left >= right or top >= bottom:
        raise ValueError("its data window lies outside its display window")
    canvas[top:bottom, left:right] = pixels[top - y : bottom - y, left - x : right - x]
    return canvas


def _are_xyz(chromaticities: Any) -> bool:
    """Return whether R, G, B hold CIE X, Y, Z; these say which light there is, and need no adaptation."""
    axes = np.atleast_1d(chromaticities)[:6]
    is_six = axes.dtype.kind == "f" and axes.shape == (6,)
    return is_six and np.allclose(axes, XYZ_CHROMATICITIES[:6], rtol=0.0, atol=SAME_CHROMATICITIES)


def to_rec709(
    rgb: np.ndarray, chromaticities: Any, name: str, fault: type[InputError], *, adapts: bool = True
) -> np.ndarray:
    """Convert linear colours [..., 3] to Rec. 709; no channel falls below 0 or the colour's own smallest.

    adapts: whether white becomes white.
    """
    matrix = _checked(rec709_from_rgb, chromaticities, name, fault)
    if not adapts:
        matrix = np.linalg.solve(xyz_from_rgb(REC709_CHROMATICITIES), xyz_from_rgb(chromaticities))
    if np.array_equal(matrix, np.eye(3)):
        return rgb
    with np.errstate(invalid="ignore", over="ignore"):  # the caller refuses infinity
        converted = rgb @ matrix.T.astype(np.float32)
    return np.maximum(converted, np.minimum(rgb.min(axis=-1, keepdims=True), 0.0))


def _checked(
    matrix: Callable[[Any], np.ndarray], chromaticities: Any, name: str, fault: type[InputError]
) -> np.ndarray:
    """Return a matrix of chromaticities; fault where they are impossible."""
    try:
        return matrix(chromaticities)
    except (TypeError, ValueError) as error:
        raise fault(
            "expected chromaticities, x, y of red, green, blue and of a white between them, "
            f"got {' '.join(str(chromaticities).split())[:120]} ({error}); save it as linear Rec. 709",
            source=name,
        ) from error


def write_channels(
    path: Path, channels: Mapping[str, np.ndarray], attributes: Mapping[str, Any], *, latlong: bool = True
) -> None:
    """Write channels [H, W] of one type with ZIP compression; in Rec. 709 unless the attributes have other
    chromaticities.

    Args:
        attributes: of the header.
        latlong: whether the header says that they are a latitude-longitude map.
    Raises:
        OSError: it cannot be written.
    """
    header = {
        "compression": "zip",
        "DateTime": "",  # the same picture is the same file
        "chromaticities": REC709_CHROMATICITIES,
        **({"textureformat": "LatLong Environment"} if latlong else {}),
        **attributes,
    }
    path.write_bytes(encode_image(np.stack(list(channels.values()), axis=-1), "openexr", header, list(channels)))
