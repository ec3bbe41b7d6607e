"""What a photo's EXIF says of how it was taken."""

from __future__ import annotations

import numpy as np
from PIL import ExifTags, Image

ON_ITS_SIDE = (5, 6, 7, 8)
"""Orientations of photos that are turned by a quarter to be shown."""


def upright_size(image: Image.Image) -> tuple[int, int]:
    """Width and height of the picture as it is shown."""
    width, height = image.size
    if image.getexif().get(ExifTags.Base.Orientation) not in ON_ITS_SIDE:
        return width, height
    if image.format == "TIFF":  # Pillow turns the size of these alone, and not in all its versions
        tags = image.tag_v2
        width, height = tags[ExifTags.Base.ImageWidth], tags[ExifTags.Base.ImageLength]
    return height, width


def exif_fov_deg(image: Image.Image) -> float | None:
    """Field of view of the longer side [degrees], 2 atan(18 / f), from the 35 mm equivalent f [mm]."""
    exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
    try:
        focal_mm = float(exif.get(ExifTags.Base.FocalLengthIn35mmFilm, 0))
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    if not 2.0 <= focal_mm <= 2000.0:  # 0 means unknown
        return None
    return float(np.degrees(2.0 * np.arctan(18.0 / focal_mm)))


def exif_exposure(image: Image.Image) -> float | None:
    """Light that reached the sensor, times its gain: t S / N^2 (ISO 2720); None where EXIF lacks one of the three."""
    exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
    tags = (ExifTags.Base.ExposureTime, ExifTags.Base.ISOSpeedRatings, ExifTags.Base.FNumber)
    try:
        seconds, iso, f_number = (
            float(value[0] if isinstance(value, tuple) else value) for value in map(exif.get, tags)
        )
        exposure = seconds * iso / f_number**2
    except (TypeError, ValueError, ZeroDivisionError, IndexError):
        return None
    return exposure if 0.0 < exposure < np.inf else None
