"""Pictures that Pillow reads with 8 bits, or not at all: 16 bits, floats and JPEG XL, decoded by OpenImageIO; and RAW
photos, recognised by their contents, developed linearly by LibRaw, never read from their embedded preview."""

import io
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from anyprobe.errors import InvalidPhoto, optional
from anyprobe.maps.image_io import ImageInput, open_image, read_pixels
from anyprobe.pictures.headers import JXL_STARTS, MAX_PIXELS, ON_ITS_SIDE, check_size, jxl_boxes, jxl_size

TIFF_STARTS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
EXIF_HEAD_BYTES = 16
"""Number of bytes in which EXIF's TIFF begins; programs put up to ten before it."""

MOST_BYTES = 16 * MAX_PIXELS
"""Largest number of bytes that a picture is decoded to: four floats a pixel."""

WHITE_IS_ZERO, BLACK_IS_ZERO, RGB = 0, 1, 2
"""Photometric interpretations of TIFF 6.0 whose samples are grey or colours."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DeepPicture:
    """A decoded picture.

    Attributes:
        values: [H, W, C] uint8 or uint16, white at the largest, or float32; not turned upright. Of 2 or 4 channels the
            last is alpha.
        premultiplied: whether colour is multiplied by alpha.
        profile: the embedded ICC profile, or empty.
        exif: bytes that begin with the file's EXIF, or empty.
        kind: Pillow's name of the format.
    """

    values: np.ndarray
    premultiplied: bool
    profile: bytes
    exif: bytes
    kind: str

    def header(self) -> Image.Image:
        """Return what Pillow would have opened: profile, EXIF and format, of a picture of one pixel."""
        image = Image.new("L", (1, 1))
        image.info["icc_profile"], image.format = self.profile, self.kind
        at = max(self.exif.find(start, 0, EXIF_HEAD_BYTES) for start in TIFF_STARTS)
        with suppress(Exception):  # its parser raises whatever the bad bytes lead it to
            image.getexif().load(b"Exif\0\0" + self.exif[at:])
        return image


def read_deep(stream: BinaryIO, head: bytes, name: str) -> DeepPicture | None:
    """Read a TIFF of 16 bits or floats, or a JPEG XL; None for any other picture, and one that Pillow has to refuse.

    Raises:
        InvalidPhoto: damaged, or too large.
    """
    if head.startswith(TIFF_STARTS):
        found = _read(stream, "tiff", name)
        stream.seek(0)
        return None if found is None else DeepPicture(**found, exif=stream.read(), kind="TIFF")
    if head.startswith(JXL_STARTS):  # its decoder works when it opens
        data = stream.read()
        width, height = jxl_size(data)
        check_size(width, height, name)
        found = _read(stream, "jpegxl", name)
        return None if found is None else DeepPicture(**found, exif=b"".join(jxl_boxes(data, b"Exif")[:1]), kind="JXL")
    return None


def read_sixteen_bits(image: Image.Image, stream: BinaryIO, name: str) -> np.ndarray | None:
    """Return a PNG of 16 bits, or a JPEG 2000 of more than 8, as uint16 [H, W, 1 to 4]; None for any other.

    image: opened by Pillow from the stream.
    """
    kind = {"PNG": "png", "JPEG2000": "jpeg2000"}.get(image.format or "")
    stream.seek(0)
    found = None if kind is None else _read(stream, kind, name)
    return None if found is None else found["values"]


def _read(stream: BinaryIO, kind: str, name: str) -> dict | None:
    """Return what a DeepPicture holds, but for its EXIF; None for 8 bits, 32-bit integers and other colour models."""
    opened = False
    try:
        with open_image(stream, kind) as image:
            opened = True
            spec, photometric = image.spec(), image.spec().get_int_attribute("tiff:PhotometricInterpretation", RGB)
            is_wide = str(spec.format) in ("uint16", "int16", "half", "float", "double")
            if photometric not in (WHITE_IS_ZERO, BLACK_IS_ZERO, RGB) or not (is_wide or kind == "jpegxl"):
                return None
            check_size(spec.width, spec.height, name)
            if (size := spec.image_bytes(True)) > MOST_BYTES:
                text = f"expected at most {MOST_BYTES >> 20} MB of pixel data, got {size >> 20} MB; save fewer channels"
                raise InvalidPhoto(text, source=name)
            values = _values(image, photometric)
            profile = spec.getattribute("ICCProfile")
            return {
                "values": values,
                "premultiplied": kind == "tiff" and not spec.get_int_attribute("oiio:UnassociatedAlpha"),
                "profile": b"" if profile is None else np.asarray(profile, np.uint8).tobytes(),
            }
    except InvalidPhoto:
        raise
    except ValueError as error:
        if not opened:
            return None
        text = f"expected a complete image, got a damaged or truncated one ({error}); copy it again"
        raise InvalidPhoto(text, source=name) from error


def _values(image: ImageInput, photometric: int) -> np.ndarray:
    """Read the colours and alpha of an open picture, integers as unsigned, white at the largest."""
    spec = image.spec()
    colors = 3 if spec.nchannels >= 3 else 1
    has_alpha = spec.alpha_channel == colors or (spec.nchannels == 2 and image.format_name() == "jpegxl")
    values = read_pixels(image, range(colors + has_alpha))
    if values.dtype.kind == "f":
        return values.astype(np.float32)
    if values.dtype == np.int16:
        values = np.rint(np.maximum(values, 0) * np.float32(65535 / 32767)).astype(np.uint16)
    if photometric == WHITE_IS_ZERO:
        values[..., 0] = np.iinfo(values.dtype).max - values[..., 0]
    return values


def heif_sixteen_bits(stream: BinaryIO) -> np.ndarray | None:
    """Return a HEIC picture of more than 8 bits as uint16 [H, W, 3 or 4], upright; None for one of 8 bits."""
    import pillow_heif

    stream.seek(0)
    picture = pillow_heif.open_heif(stream, convert_hdr_to_8bit=False)
    return np.array(picture) if picture.mode in ("RGB;16", "RGBA;16") else None


def turned_upright(values: np.ndarray, orientation: int) -> np.ndarray:
    """Turn an array [H, W, ...] upright from its EXIF orientation."""
    if orientation in ON_ITS_SIDE:
        values = values.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        values = values[:, ::-1]
    if orientation in (3, 4, 7, 8):
        values = values[::-1]
    return np.ascontiguousarray(values)


def straight(values: np.ndarray) -> np.ndarray:
    """Divide premultiplied colours of integers by their alpha."""
    top = np.iinfo(values.dtype).max
    share = np.maximum(values[..., -1:], 1) / np.float32(top)
    color = np.rint(np.minimum(values[..., :-1] / share, top))
    return np.concatenate([color.astype(values.dtype), values[..., -1:]], axis=-1)


RAW_SUFFIXES = (
    *(".dng", ".nef", ".nrw", ".cr2", ".cr3", ".arw", ".srf", ".sr2", ".raf", ".orf", ".rw2", ".pef", ".srw"),
    *(".3fr", ".iiq", ".rwl"),
)

STARTS = (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"\x00MRM", b"FOVb")
"""First bytes of formats that are not TIFF: Fujifilm, Olympus, Panasonic, Minolta, Sigma."""

CR3_BRAND, CR2_MARK = b"crx ", b"CR"

DNG_VERSION, SUBFILE, PHOTOMETRIC = 50706, 254, 262
"""Tags of a TIFF: of DNG alone; 1 for a smaller version of another picture; and how values mean colours."""
MOSAIC, LINEAR_RAW = 32803, 34892
"""Photometric interpretations of DNG and TIFF/EP: colour filter array, and linear colour."""

HEAD_BYTES = 1 << 20
"""Number of bytes at the start of a file in which a TIFF's first directory, or an AVIF's boxes, are looked for."""


def is_raw(head: bytes, name: str) -> bool:
    """Return whether a file is a camera's raw data, by its first HEAD_BYTES.

    name: of the file; its suffix decides where a TIFF's first directory lies further on.
    """
    if head.startswith(STARTS) or (head[4:8] == b"ftyp" and head[8:12] == CR3_BRAND):
        return True
    if head[:4] not in TIFF_STARTS:
        return False
    return head[8:10] == CR2_MARK or Path(name).suffix.lower() in RAW_SUFFIXES or _begins_as_raw(head)


def _begins_as_raw(head: bytes) -> bool:
    """Return whether the first directory of a TIFF is a camera's: of DNG, of a mosaic, or of a preview of what
    follows."""
    with suppress(Exception):  # its parser raises whatever the bad bytes lead it to
        stream, tags = io.BytesIO(head), ImageFileDirectory_v2(head[:8])
        stream.seek(tags.next)
        tags.load(stream)
        return DNG_VERSION in tags or tags.get(SUBFILE) == 1 or tags.get(PHOTOMETRIC) in (MOSAIC, LINEAR_RAW)
    return False


def raw_size(data: bytes) -> tuple[int, int] | None:
    """Width and height of a raw photo, upright; None where LibRaw is missing or cannot read it."""
    with suppress(Exception):  # LibRaw's errors, and whatever the bad bytes lead it to
        import rawpy

        with rawpy.imread(io.BytesIO(data)) as raw:
            width, height = raw.sizes.iwidth, raw.sizes.iheight
            return (height, width) if raw.sizes.flip in (5, 6) else (width, height)
    return None


def develop(data: bytes, name: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return a raw photo as linear Rec. 709 radiance [H, W, 3] float32, upright, and warnings.

    With the camera's white balance, the sensor's saturation at 1, and nothing brightened.

    Raises:
        MissingExtra: without its reader. InvalidPhoto: damaged, too large, or of a camera that LibRaw does not know.
    """
    rawpy = optional("rawpy", "rawpy", "raw", f"{name}: a RAW photo")
    notes: tuple[str, ...] = ()
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            check_size(raw.sizes.iwidth, raw.sizes.iheight, name)
            balanced = all(np.isfinite(gain) and gain > 0 for gain in raw.camera_whitebalance[:3])
            if not balanced:
                notes = ("expected a RAW photo with the camera's white balance, found none; daylight is assumed",)
            form: dict[str, Any] = {"gamma": (1, 1), "output_bps": 16, "output_color": rawpy.ColorSpace.sRGB}
            values = raw.postprocess(no_auto_bright=True, adjust_maximum_thr=0.0, use_camera_wb=balanced, **form)
    except InvalidPhoto:
        raise
    except Exception as error:  # LibRaw's errors, and whatever the bad bytes lead it to
        reason = " ".join(str(error).replace("b'", "").replace("'", "").split())[:120] or type(error).__name__
        raise InvalidPhoto(
            f"expected a RAW photo that LibRaw can develop, got {reason}; copy it again, or export it "
            "from a RAW converter as 16-bit TIFF",
            source=name,
        ) from error
    return np.divide(values, np.float32(65535.0), dtype=np.float32), notes
