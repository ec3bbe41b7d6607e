"""Headers of photos, read before decoding: format, EXIF with Apple's maker note, and what takes too long to decode."""

import io
from contextlib import suppress
from importlib import import_module
from itertools import islice
from typing import Any, BinaryIO, cast

import numpy as np
from PIL import ExifTags, Image, ImageFile
from PIL.TiffImagePlugin import ImageFileDirectory_v2, TiffImageFile

from anyprobe.errors import InvalidPhoto, optional
from anyprobe.notices import CHOOSE_PHOTO, USE_VIDEO, Remedy
from anyprobe.pictures.file_parts import iso_boxes, markers

MAX_PIXELS = 100_000_000
"""Largest number of pixels of a photo that is decoded; checked in the header first."""

MIN_SIDE_PX, MAX_SIDE_PX = 32, 65_535
"""Smallest and largest height and width [px] of a photo; the largest is JPEG's own."""

MAX_SCANS = 32
"""Largest number of scans of a progressive JPEG, each of which covers the whole picture; encoders write about ten."""

PHOTO_FORMATS = ("JPEG", "MPO", "PNG", "WEBP", "TIFF", "BMP", "GIF", "PPM", "JPEG2000", "AVIF", "HEIF")
"""Formats that may be opened; others that Pillow knows start programs or are not pictures."""

for _reader in ("Avif", "Bmp", "Gif", "Jpeg2K", "Jpeg", "Mpo", "Png", "Ppm", "WebP"):
    import_module(f"PIL.{_reader}ImagePlugin")  # not at the first photo: a process forked while a thread imports hangs

ON_ITS_SIDE = (5, 6, 7, 8)
"""EXIF orientations that are shown turned by a quarter."""

_HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")
_JPEG_START = b"\xff\xd8\xff"
JXL_BOX = b"\0\0\0\x0cJXL \r\n\x87\n"
JXL_STARTS = (b"\xff\x0a", JXL_BOX)

TRUNCATED = "a damaged or truncated {}; copy it again from its source"
KINDS_BY_START = {
    b"\xff\xd8": TRUNCATED.format("JPEG"),
    b"\x89PNG": TRUNCATED.format("PNG"),
    b"GIF8": TRUNCATED.format("GIF"),
    b"BM": TRUNCATED.format("BMP"),
    b"RIFF": TRUNCATED.format("WebP"),
    **dict.fromkeys(
        (b"II*\0", b"MM\0*"), "a damaged, truncated or unusual TIFF; copy it again, or save it as plain TIFF or OpenEXR"
    ),
    **dict.fromkeys((b"II+\0", b"MM\0+"), "a TIFF of more than 4 GB (BigTIFF); save it as plain TIFF or OpenEXR"),
    **dict.fromkeys(JXL_STARTS, TRUNCATED.format("JPEG XL")),
    **dict.fromkeys((b"\xff\x4f\xff\x51", b"\0\0\0\x0cjP"), TRUNCATED.format("JPEG 2000")),
    b"8BPS": "a Photoshop document; export a flat picture, of 16 bits as TIFF or PNG, of 32 bits as OpenEXR",
    b"%PDF": "a PDF document; export its picture as PNG or TIFF",
    b"%!PS": "a PostScript document; export its picture as PNG or TIFF",
    b"<svg": "an SVG drawing, not a photo; export it as PNG",
    **dict.fromkeys((b"PF", b"Pf"), "a PFM picture; save it as OpenEXR (.exr), which keeps its range"),
    b"\x1aE\xdf\xa3": "a video; anyprobe video takes it",
    b"PK\x03\x04": "a ZIP archive, as Krita's documents are; unpack it, or export its picture",
    b"gimp xcf": "a GIMP document; export it as PNG or TIFF",
    **dict.fromkeys((b"SDPX", b"XPDS", b"\x80\x2a\x5f\xd7"), "a DPX or Cineon frame; convert it to OpenEXR"),
    **dict.fromkeys(
        (b"<!DOCTYPE", b"<!doctype", b"<html"), "a web page, as a failed download leaves; download it again"
    ),
    b"version https://git-lfs": "a pointer of Git LFS; git lfs pull fetches the file",
}
"""Descriptions of unreadable files, and what to do with them, by their first bytes."""
BRANDS = {
    **dict.fromkeys((b"avif", b"avis"), TRUNCATED.format("AVIF")),
    **dict.fromkeys(_HEIC_BRANDS, TRUNCATED.format("HEIC")),
}
"""The same by the brand of an ISO base media file; other brands are videos."""


class UnknownPicture(Exception):
    """The file has none of PHOTO_FORMATS, or a damaged header."""


def open_picture(stream: BinaryIO, name: str = "photo") -> ImageFile.ImageFile:
    """Open a picture: its header is read, its pixels are not.

    Unlike Image.open it does not warn of large pictures; check_size refuses them.

    Raises:
        UnknownPicture: it cannot be read.
        InvalidPhoto: decoding it would take too long.
        MissingExtra: a HEIC photo without its reader installed.
    """
    head = stream.read(64)
    brands = head[16 : int.from_bytes(head[:4], "big")]  # besides the main one
    if head[4:8] == b"ftyp" and head[8:12] in _HEIC_BRANDS and b"avif" not in brands:
        optional("pillow_heif", "pillow-heif", "heic", f"{name}: a HEIC photo").register_heif_opener()
    for kind in PHOTO_FORMATS:
        factory, accepts = Image.OPEN.get(kind, (None, None))
        if factory is None or (accepts is not None and accepts(head) is not True):
            continue
        stream.seek(0)
        try:
            picture = factory(stream, "")
        except Exception:  # decoders raise whatever the bad bytes lead them to
            continue
        if head.startswith(_JPEG_START):
            _check_scans(stream, name)
        return picture
    raise UnknownPicture


def check_size(width: int, height: int, name: str) -> None:
    """Raise InvalidPhoto if a picture is too large to be decoded or too small for a photo."""
    if width * height > MAX_PIXELS:
        wanted, remedy = f"at most {MAX_PIXELS // 1_000_000} million pixels", "shrink it first"
    elif max(width, height) > MAX_SIDE_PX:
        wanted, remedy = f"at most {MAX_SIDE_PX} pixels on either side", "crop it"
    elif min(width, height) < MIN_SIDE_PX:
        wanted, remedy = f"at least {MIN_SIDE_PX} pixels on either side", "use the original photo"
    else:
        return
    raise InvalidPhoto(f"expected {wanted}, got {width} x {height}; {remedy}", source=name)


def upright_size(image: Image.Image) -> tuple[int, int]:
    """Return width and height of the picture as it is shown."""
    width, height = image.size
    if exif_of(image).get(ExifTags.Base.Orientation) not in ON_ITS_SIDE:
        return width, height
    if image.format == "TIFF":  # some versions of Pillow turn the size of TIFFs, and of no others
        tags = cast(TiffImageFile, image).tag_v2
        width, height = tags[ExifTags.Base.ImageWidth], tags[ExifTags.Base.ImageLength]
    return height, width


def exif_fov_deg(image: Image.Image) -> float | None:
    """Return the field of view [degrees] of the longer side, 2 atan(18 / f), f the 35 mm equivalent [mm]; or None."""
    try:
        focal_mm = float(exif_of(image, ExifTags.IFD.Exif).get(ExifTags.Base.FocalLengthIn35mmFilm, 0))
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    if not 2.0 <= focal_mm <= 2000.0:  # 0 means unknown
        return None
    return float(np.degrees(2.0 * np.arctan(18.0 / focal_mm)))


def exif_exposure(image: Image.Image) -> float | None:
    """Return the exposure t S / N^2 [s x ISO] (ISO 2720): the sensor's light times its gain; None if EXIF lacks any."""
    exif = exif_of(image, ExifTags.IFD.Exif)
    tags = (ExifTags.Base.ExposureTime, ExifTags.Base.ISOSpeedRatings, ExifTags.Base.FNumber)
    try:
        values = (value[0] if isinstance(value, tuple) else value for value in map(exif.get, tags))
        seconds, iso, f_number = map(float, values)
        exposure = seconds * iso / f_number**2
    except (TypeError, ValueError, ZeroDivisionError, OverflowError, IndexError):
        return None
    return exposure if 0.0 < exposure < np.inf else None


def kind_of(head: bytes, num_bytes: int) -> tuple[str, tuple[Remedy, ...]]:
    """Return the description of an unreadable file from its first bytes, and remedies."""
    if head[4:8] == b"ftyp":
        picture = BRANDS.get(head[8:12])
        return ("a video", (Remedy("run", USE_VIDEO),)) if picture is None else (picture, ())
    if (found := next((kind for start, kind in KINDS_BY_START.items() if head.startswith(start)), None)) is not None:
        return found, ()
    return f"{num_bytes} bytes of something else", (Remedy("run", CHOOSE_PHOTO),)


def orientation_of(image: Image.Image) -> int:
    """Return the EXIF orientation; 1, upright, if that is damaged, or if the reader has turned the picture already."""
    if image.format == "JXL":
        return 1
    with suppress(Exception):  # its parser raises whatever the bad bytes lead it to
        return int(image.getexif().get(ExifTags.Base.Orientation, 1))
    return 1


def jxl_size(data: bytes) -> tuple[int, int]:
    """Return width and height from the first bytes of a JPEG XL file (ISO/IEC 18181-1, SizeHeader); else 0, 0."""
    if data.startswith(JXL_BOX):
        data = b"".join(jxl_boxes(data, b"jxlc") or [part[4:] for part in jxl_boxes(data, b"jxlp")])
    bits, place = int.from_bytes(data[2:18].ljust(16, b"\0"), "little"), 0

    def read(count: int) -> int:
        nonlocal place
        place += count
        return bits >> (place - count) & ((1 << count) - 1)

    def side(small: bool) -> int:
        return (read(5) + 1) * 8 if small else read((9, 13, 18, 30)[read(2)]) + 1

    if not data.startswith(JXL_STARTS[0]):
        return 0, 0
    small = bool(read(1))
    height = side(small)
    ratio = ((0, 1), (1, 1), (12, 10), (4, 3), (3, 2), (16, 9), (5, 4), (2, 1))[read(3)]
    return (side(small) if ratio[0] == 0 else height * ratio[0] // ratio[1]), height


def jxl_boxes(data: bytes, wanted: bytes) -> list[bytes]:
    """Return the contents of a JPEG XL file's boxes of a kind (ISO/IEC 18181-2)."""
    found = []
    with suppress(ValueError):  # cut, or a bare codestream
        for kind, (at, end) in iso_boxes(data, (0, len(data))):
            if kind == wanted:
                found.append(data[at:end])
    return found


def exif_of(image: Image.Image, directory: int | None = None) -> Any:
    """Return EXIF tags; empty if they are damaged, since the picture can be used without them."""
    with suppress(Exception):  # its parser raises whatever the bad bytes lead it to
        return image.getexif() if directory is None else image.getexif().get_ifd(directory)
    return {}


def _check_scans(stream: BinaryIO, name: str) -> None:
    """Raise InvalidPhoto for a JPEG of more than MAX_SCANS scans, behind its end aside; or for one sent as text, whose
    line feeds all follow carriage returns: decoders make noise of it."""
    place = stream.tell()
    stream.seek(0)
    data = stream.read()
    stream.seek(place)
    if data.count(b"\r\n") == data.count(b"\n") > 4:
        text = "expected a JPEG as it was saved, got bytes changed by a transfer as text; copy it again, as binary data"
        raise InvalidPhoto(text, source=name)
    scans = (code for code, _ in markers(data, 2) if code == b"\xda")
    if len(list(islice(scans, MAX_SCANS + 1))) > MAX_SCANS:
        text = f"expected a JPEG of at most {MAX_SCANS} scans, got more; save it again as PNG or JPEG"
        raise InvalidPhoto(text, source=name)


# Apple's maker note in EXIF: signed rationals by tag, among them the direction of gravity. Tags and axes: ExifTool,
# Image::ExifTool::Apple. The accelerometer's vector is in units of g along the screen's left, the screen's lower edge,
# and into the screen; of a phone at rest it is upward.

_NOTE, _DIRECTORY = b"Apple iOS\0", 14
_BEGINS = {b"II": b"II*\0\0\0\0\0", b"MM": b"MM\0*\0\0\0\0"}
_SIGNED_RATIONAL = 10
_ACCELERATION = 8
AT_REST = (0.9, 1.1)
"""Range of the length [g] of the accelerometer's vector in which a phone counts as at rest."""
MOST_ROLL_DEG = 40.0
"""Largest roll [degrees] of a picture that counts as upright."""
_UPRIGHT = {
    1: ((0, 1, 0), (-1, 0, 0)),
    3: ((0, -1, 0), (1, 0, 0)),
    6: ((-1, 0, 0), (0, -1, 0)),
    8: ((1, 0, 0), (0, 1, 0)),
}
"""Right and up of the shown picture in the accelerometer's axes, by EXIF orientation; a phone held upright writes 6."""


def apple_numbers(image: Image.Image) -> dict[int, tuple[float, ...]]:
    """Return the note's signed rationals by tag; empty where there is no note, or a damaged one."""
    try:
        note = bytes(exif_of(image, ExifTags.IFD.Exif).get(ExifTags.Base.MakerNote, b""))
        if not note.startswith(_NOTE):
            return {}
        stream, tags = io.BytesIO(note), ImageFileDirectory_v2(_BEGINS[note[12:14]])
        stream.seek(_DIRECTORY)
        tags.load(stream)
        found = {tag: np.atleast_1d(tags[tag]) for tag, kind in tags.tagtype.items() if kind == _SIGNED_RATIONAL}
        return {tag: tuple(float(one) if one.denominator else 0.0 for one in numbers) for tag, numbers in found.items()}
    except Exception:  # its parser raises whatever the bad bytes lead it to
        return {}


def apple_posture_deg(image: Image.Image) -> tuple[float, float] | None:
    """Return the camera's pitch downwards and its roll [degrees], see estimate.ground.Ground; None where unknown.

    Known for the rear camera of a phone at rest, in a picture that is shown upright.
    """
    up = np.array(apple_numbers(image).get(_ACCELERATION, ()))
    axes = _UPRIGHT.get(exif_of(image).get(ExifTags.Base.Orientation, 1))
    lens = str(exif_of(image, ExifTags.IFD.Exif).get(ExifTags.Base.LensModel, ""))
    if len(up) != 3 or axes is None or "front" in lens.lower() or not AT_REST[0] <= np.linalg.norm(up) <= AT_REST[1]:
        return None
    right, above = (float(up @ axis) for axis in np.array(axes))
    pitch, roll = np.degrees(np.arctan2([-up[2], right], [np.hypot(right, above), above])).tolist()
    return (pitch, roll) if abs(roll) <= MOST_ROLL_DEG else None
