"""Embedded colour profiles (ICC.1), interpreted by their contents, never by their names.

Profiles of primaries and curves are read here, for pictures of any depth; profiles with tables, and all pictures of 8
bits, are left to LittleCMS.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable

import numpy as np
from PIL import Image, ImageCms

from anyprobe.pictures.color_encoding import ColorEncoding, by_code_points, gamma

_HEADER_BYTES = 128
MAX_TAGS, MAX_POINTS = 200, 1 << 16

SRGB_D50 = np.array(
    [[0.4360657, 0.3851514, 0.1430784], [0.2224932, 0.7168870, 0.0606169], [0.0139237, 0.0970764, 0.7140961]]
)
"""Columns of CIE XYZ of sRGB's primaries as its profiles have them, adapted to their white, D50."""

PARAMETRIC = ("g", "gab", "gabc", "gabcd", "gabcdef")
"""Names of a parametric curve's parameters, by its type."""

Curve = Callable[[np.ndarray], np.ndarray]


def encoding_of(profile: bytes) -> ColorEncoding | None:
    """Return the encoding of a profile of code points, of curves and primaries, or of one grey curve.

    Returns:
        None where it is damaged, or has tables or another colour space.
    """
    try:
        tags = _tags(profile)
        if "cicp" in tags and len(tags["cicp"]) >= 12:
            primaries, transfer, _, full = tags["cicp"][8:12]
            found = by_code_points(primaries, transfer, bool(full))
            if found is not None and found.is_hdr:
                return found
        space, connection = profile[16:20], profile[20:24]
        if space == b"GRAY" and connection == b"XYZ ":
            curve = _curve(tags["kTRC"])
            return ColorEncoding(matrix=np.eye(3), decode=curve)
        if space != b"RGB " or connection != b"XYZ " or any(name.startswith("A2B") for name in tags):
            return None
        columns = np.stack([_xyz(tags[f"{name}XYZ"]) for name in "rgb"], axis=1)
        matrix = np.linalg.solve(SRGB_D50, columns)
        curves = [_curve(tags[f"{name}TRC"]) for name in "rgb"]
    except (KeyError, ValueError, IndexError, struct.error):  # LinAlgError is a ValueError
        return None

    def decode(values: np.ndarray) -> np.ndarray:
        return np.stack([curve(values[..., k]) for k, curve in enumerate(curves)], axis=-1)

    return ColorEncoding(matrix=matrix, decode=decode)


def converted(image: Image.Image, profile: bytes) -> Image.Image:
    """Convert a picture of 8 bits (L, RGB or CMYK) to sRGB by LittleCMS.

    Raises:
        ValueError: the profile is damaged, or for another colour model.
    """
    try:
        embedded = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        srgb, intent = ImageCms.createProfile("sRGB"), ImageCms.Intent.RELATIVE_COLORIMETRIC
        done = ImageCms.profileToProfile(image, embedded, srgb, renderingIntent=intent, outputMode="RGB")
    except (ImageCms.PyCMSError, OSError, ValueError) as error:
        raise ValueError(" ".join(str(error).split())) from error
    assert done is not None
    return done


def _tags(profile: bytes) -> dict[str, bytes]:
    """Return a profile's tags by signature; struct.error or ValueError if it is not a profile."""
    if profile[36:40] != b"acsp":
        raise ValueError("no profile")
    (count,) = struct.unpack_from(">I", profile, _HEADER_BYTES)
    found = {}
    for k in range(min(count, MAX_TAGS)):
        name, at, size = struct.unpack_from(">4sII", profile, _HEADER_BYTES + 4 + 12 * k)
        found[name.decode("latin-1")] = profile[at : at + size]
    return found


def _xyz(tag: bytes) -> np.ndarray:
    return np.array(struct.unpack_from(">3i", tag, 8)) / 65536.0


def _curve(tag: bytes) -> Curve:
    """Return a curve's tag as a function of values in [0, 1]."""
    if tag[:4] == b"para":
        (kind,) = struct.unpack_from(">H", tag, 8)
        names = PARAMETRIC[kind]
        values = np.array(struct.unpack_from(f">{len(names)}i", tag, 12)) / 65536.0
        return _parametric(dict(zip(names, values, strict=True)))
    if tag[:4] != b"curv":
        raise ValueError("no curve")
    (count,) = struct.unpack_from(">I", tag, 8)
    if count == 0:
        return lambda values: values
    if count == 1:
        (exponent,) = struct.unpack_from(">H", tag, 12)
        return gamma(exponent / 256.0)
    if count > MAX_POINTS:
        raise ValueError("a curve too long")
    points = np.frombuffer(tag, ">u2", count, 12).astype(np.float32) / 65535.0
    places = np.linspace(0.0, 1.0, count, dtype=np.float32)
    return lambda values: np.interp(values, places, points).astype(np.float32)


def _parametric(p: dict[str, float]) -> Curve:
    """Return the curve of ICC.1:2022, table 68: (a x + b)^g + e for x >= d, else c x + f."""
    g, a, b = p["g"], p.get("a", 1.0), p.get("b", 0.0)
    if "d" in p:
        start, slope, low, high = p["d"], p["c"], p.get("f", 0.0), p.get("e", 0.0)
    else:
        start = -b / a if a and "a" in p else 0.0
        slope, low, high = 0.0, p.get("c", 0.0), p.get("c", 0.0)

    def curve(values: np.ndarray) -> np.ndarray:
        return np.where(values >= start, np.clip(a * values + b, 0.0, None) ** g + high, slope * values + low)

    return curve
