"""Size that a picture's file declares, for every kind that is read; nothing is decoded."""

import io
import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.files.paths import open_regular
from anyprobe.maps.exr import EXR_MAGIC, exr_pixels
from anyprobe.maps.image_io import open_image
from anyprobe.maps.radiance import HDR_MAGIC, hdr_pixels
from anyprobe.pictures.deep_pixels import HEAD_BYTES, TIFF_STARTS, is_raw, raw_size
from anyprobe.pictures.headers import JXL_STARTS, UnknownPicture, exif_fov_deg, jxl_size, open_picture, upright_size


def declared_pixels(data: bytes) -> int:
    """Return the number of pixels that a file's bytes would be decoded to; 0 if they are no picture or map."""
    if data.startswith(EXR_MAGIC):
        with suppress(ValueError), open_image(data, "openexr") as image:
            return exr_pixels(image.spec())
        return 0
    if data.startswith(HDR_MAGIC):
        return hdr_pixels(data)
    (width, height), _ = photo_header(data)
    return width * height


def photo_header(source: str | os.PathLike[str] | bytes) -> tuple[tuple[int, int], float | None]:
    """Return the upright width and height of a photo, and the field of view [degrees] from its EXIF or None.

    0, 0 and None where the header cannot be read; read_image then says why.
    """
    name = "" if isinstance(source, bytes) else Path(source).name
    with suppress(UnknownPicture, AnyprobeError):
        with io.BytesIO(source) if isinstance(source, bytes) else open_regular(source, InputError) as stream:
            return _header(stream, name)
    return (0, 0), None


def _header(stream: BinaryIO, name: str) -> tuple[tuple[int, int], float | None]:
    head = stream.read(64)
    if head.startswith(TIFF_STARTS):
        head += stream.read(HEAD_BYTES)
    stream.seek(0)
    if head.startswith(JXL_STARTS):  # its reader decodes whatever it opens
        return jxl_size(stream.read()), None
    size = raw_size(stream.read()) if is_raw(head, name) else None  # its first picture is a preview
    stream.seek(0)
    try:
        with open_picture(stream) as image:
            return size or upright_size(image), exif_fov_deg(image)
    except UnknownPicture:
        if size is None and head.startswith(TIFF_STARTS):
            with suppress(ValueError), open_image(stream, "tiff") as tiff:
                size = tiff.spec().width, tiff.spec().height
        if size is None:
            raise
        return size, None
