"""Colour encoding that a picture's file declares, and its pixels in sRGB.

Sources, in this order: code points of a PNG (cICP), an embedded profile, code points of HEIC and AVIF (nclx), a PNG's
gAMA and cHRM where it does not say sRGB, EXIF's Adobe RGB (R03). A file without any is sRGB.

Profiles (ICC.1) are interpreted by their contents, never by their names. Those of primaries and curves are read here,
for pictures of any depth; profiles with tables, and all pictures of 8 bits, are left to LittleCMS.
"""

import io
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import BinaryIO

import numpy as np
from PIL import ExifTags, Image, ImageCms

from anyprobe.maps.image_io import open_image
from anyprobe.pictures import color_encoding
from anyprobe.pictures.color_encoding import ColorEncoding, by_code_points, by_numbers, is_srgb
from anyprobe.pictures.deep_pixels import HEAD_BYTES
from anyprobe.pictures.file_parts import iso_boxes
from anyprobe.pictures.headers import exif_of

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
            if (found := by_code_points(primaries, transfer, bool(full))) is not None and found.is_hdr:
                return found
        space, connection = profile[16:20], profile[20:24]
        if space == b"GRAY" and connection == b"XYZ ":
            return ColorEncoding(matrix=np.eye(3), decode=_curve(tags["kTRC"]))
        if space != b"RGB " or connection != b"XYZ " or any(name.startswith("A2B") for name in tags):
            return None
        columns = np.stack([struct.unpack_from(">3i", tags[f"{name}XYZ"], 8) for name in "rgb"], axis=1) / 65536.0
        matrix = np.linalg.solve(SRGB_D50, columns)
        curves = [_curve(tags[f"{name}TRC"]) for name in "rgb"]
    except (KeyError, ValueError, IndexError, struct.error):  # LinAlgError is a ValueError
        return None

    def decode(values: np.ndarray) -> np.ndarray:
        return np.stack([curve(values[..., k]) for k, curve in enumerate(curves)], axis=-1)

    return ColorEncoding(matrix=matrix, decode=decode)


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
        return color_encoding.gamma(exponent / 256.0)
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


USUAL_GAMMA = 1 / 2.2
"""PNG gamma by which most programs mean sRGB."""
GAMMA_TOLERANCE = 0.005

ADOBE_GAMMA = 563 / 256
R03, INTEROPERABILITY = "R03", 1
"""EXIF's name for Adobe RGB (DCF), and the tag that holds it."""


def declared_encoding(
    image: Image.Image, stream: BinaryIO | None
) -> tuple[ColorEncoding | None, bytes, tuple[str, ...]]:
    """Return the encoding or the ICC profile that a picture declares, neither for sRGB, and warnings.

    Args:
        image: opened by Pillow, its file still open where it has one.
        stream: the file, for what Pillow does not return; None where there is none.
    """
    if image.mode == "LAB":  # absolute: Pillow converts it, and a profile adds nothing
        return None, b"", ()
    profile = image.info.get("icc_profile") or b""
    points = _code_points(image, stream)
    if points is not None and (image.format == "PNG" or not profile):
        primaries, transfer, full, bits = points
        if (primaries, transfer) == (2, 2):
            return None, profile, ()
        encoding = by_code_points(primaries, transfer, full, bits)
        note = f"its colour encoding (primaries {primaries}, transfer {transfer}) is unknown; read as sRGB"
        return encoding, b"", (note,) if encoding is None else ()
    if profile:
        return None, profile, ()
    if image.format == "PNG" and "srgb" not in image.info:
        return _by_gamma(image), b"", ()
    if image.format in ("JPEG", "MPO", "TIFF"):
        if str(exif_of(image, ExifTags.IFD.Interop).get(INTEROPERABILITY, ""))[:3] == R03:
            return by_numbers(color_encoding.ADOBE_RGB, ADOBE_GAMMA), b"", ()
    return None, b"", ()


def to_srgb(
    picture: Image.Image | np.ndarray, encoding: ColorEncoding | None, profile: bytes = b""
) -> tuple[np.ndarray, np.ndarray | None, tuple[str, ...]]:
    """Convert a picture from an encoding or a profile to sRGB; unchanged if it has neither.

    picture: L, RGB or CMYK of Pillow; or [H, W] or [H, W, 3] of 16 bits or floats.

    Returns:
        Values [H, W] or [H, W, 3], uint8, uint16 or float in [0, 1]; radiance [H, W, 3], linear Rec. 709, above white
        too, or None; and warnings, one line each, without the picture's name.
    """
    has_8_bits = isinstance(picture, Image.Image)
    if profile:
        encoding = encoding_of(profile)
        mode = picture.mode if isinstance(picture, Image.Image) else "L" if picture.ndim == 2 else "RGB"
        if profile[16:20] != {"L": b"GRAY", "RGB": b"RGB ", "CMYK": b"CMYK"}[mode] and profile[36:40] == b"acsp":
            return _plain(picture), None, (UNFIT,)
        if encoding is None or (has_8_bits and not encoding.is_hdr and not is_srgb(encoding)):
            return _by_table(picture, profile)
    values = _plain(picture)
    if encoding is None or is_srgb(encoding):
        return values, None, ()
    return *color_encoding.to_display(values, encoding), ()


UNFIT = "its colour profile is damaged or for another colour model; read as sRGB"


def _plain(picture: Image.Image | np.ndarray) -> np.ndarray:
    """Return its values unconverted, [H, W] or [H, W, 3]."""
    if isinstance(picture, Image.Image):
        return np.asarray(picture if picture.mode in ("L", "RGB") else picture.convert("RGB"))
    return picture


def _by_table(picture: Image.Image | np.ndarray, profile: bytes) -> tuple[np.ndarray, None, tuple[str, ...]]:
    """Convert by LittleCMS, with 8 bits; unconverted, with UNFIT, where the profile is damaged or for another model."""
    if not isinstance(picture, Image.Image):
        scaled = picture * 255.0 if picture.dtype.kind == "f" else picture / 257.0
        picture = Image.fromarray(np.clip(np.round(scaled), 0, 255).astype(np.uint8))
    with suppress(ImageCms.PyCMSError, OSError, ValueError):
        embedded = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        srgb, intent = ImageCms.createProfile("sRGB"), ImageCms.Intent.RELATIVE_COLORIMETRIC
        done = ImageCms.profileToProfile(picture, embedded, srgb, renderingIntent=intent, outputMode="RGB")
        return np.asarray(done), None, ()
    return _plain(picture), None, (UNFIT,)


def _code_points(image: Image.Image, stream: BinaryIO | None) -> tuple[int, int, bool, int] | None:
    """Return primaries, transfer, whether the range is full, and bits, where the file has H.273's code points."""
    if image.format == "PNG" and stream is not None:
        return _cicp(stream)
    if image.format == "HEIF":
        nclx = image.info.get("nclx_profile")
        return None if not nclx else (int(nclx["color_primaries"]), int(nclx["transfer_characteristics"]), True, 8)
    if image.format == "AVIF" and stream is not None:
        return _nclx(stream)
    return None


def _cicp(stream: BinaryIO) -> tuple[int, int, bool, int] | None:
    """Return the code points of a PNG's cICP chunk, None without one."""
    place, found, kind = stream.tell(), None, np.dtype(np.uint8)
    with suppress(ValueError), open_image(stream, "png") as image:  # of a damaged one Pillow says why
        found, kind = image.spec().getattribute("CICP"), np.dtype(str(image.spec().format))
    stream.seek(place)
    return None if found is None else (found[0], found[1], found[3] == 1, 8 * kind.itemsize)


def _nclx(stream: BinaryIO) -> tuple[int, int, bool, int] | None:
    """Return the code points of an AVIF's first nclx property, None without one; the decoder handles the range."""
    place = stream.tell()
    stream.seek(0)
    data = stream.read(HEAD_BYTES)
    stream.seek(place)
    span = (0, len(data))
    with suppress(StopIteration, ValueError):  # it has none, or is damaged
        for wanted, skipped in ((b"meta", 4), (b"iprp", 0), (b"ipco", 0)):
            start, end = next(found for kind, found in iso_boxes(data, span) if kind == wanted)
            span = (start + skipped, end)
        for kind, (at, end) in iso_boxes(data, span):
            if kind == b"colr" and data[at : at + 4] == b"nclx" and end - at >= 10:
                primaries, transfer = struct.unpack_from(">HH", data, at + 4)
                return primaries, transfer, True, 8
    return None


def _by_gamma(image: Image.Image) -> ColorEncoding | None:
    """Return the encoding of a PNG's gAMA and cHRM; sRGB's curve for the usual gamma."""
    gamma, found = image.info.get("gamma"), image.info.get("chromaticity")
    if not gamma and not found:
        return None
    if gamma and (not 0.01 < gamma < 100 or abs(gamma - USUAL_GAMMA) < GAMMA_TOLERANCE):
        gamma = None
    white_first = tuple(map(float, found)) if found else None
    return by_numbers(white_first and white_first[2:] + white_first[:2], None if not gamma else 1.0 / gamma)
