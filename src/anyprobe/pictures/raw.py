"""RAW photos: recognised by their contents, developed linearly by LibRaw, never read from their embedded preview."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from anyprobe.errors import InvalidPhoto, MissingExtra
from anyprobe.pictures.deep_pixels import TIFF_STARTS
from anyprobe.pictures.headers import check_size

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
    try:
        stream, tags = io.BytesIO(head), ImageFileDirectory_v2(head[:8])
        stream.seek(tags.next)
        tags.load(stream)
        return DNG_VERSION in tags or tags.get(SUBFILE) == 1 or tags.get(PHOTOMETRIC) in (MOSAIC, LINEAR_RAW)
    except Exception:  # its parser raises whatever the bad bytes lead it to
        return False


def raw_size(data: bytes) -> tuple[int, int] | None:
    """Width and height of a raw photo, upright; None where LibRaw is missing or cannot read it."""
    try:
        import rawpy

        with rawpy.imread(io.BytesIO(data)) as raw:
            width, height = raw.sizes.iwidth, raw.sizes.iheight
            return (height, width) if raw.sizes.flip in (5, 6) else (width, height)
    except Exception:  # LibRaw's errors, and whatever the bad bytes lead it to
        return None


def develop(data: bytes, name: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return a raw photo as linear Rec. 709 radiance [H, W, 3] float32, upright, and warnings.

    With the camera's white balance, the sensor's saturation at 1, and nothing brightened.

    Raises:
        MissingExtra: without its reader. InvalidPhoto: damaged, too large, or of a camera that LibRaw does not know.
    """
    try:
        import rawpy
    except ImportError as error:
        raise MissingExtra("rawpy", "raw", f"{name}: a RAW photo", error) from error
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
