"""Where the sun stands: a side and a height, a direction, or by the place, time and heading that the photo notes.

load_photo keeps it (`place_of_sun`); refine turns it into the input `sun` of light.onnx (`towards_sun`).
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from PIL import ExifTags, Image

from anyprobe.core import Float
from anyprobe.errors import InputError, InvalidPhoto, MissingExtra
from anyprobe.files.paths import open_regular
from anyprobe.inputs.hints import read_sun
from anyprobe.notices import give
from anyprobe.pictures.headers import UnknownPicture, open_picture


def place_of_sun(given: str | Sequence[float] | None, source: Any) -> tuple[float, ...] | None:
    """Return the hint `sun` as numbers, see towards_sun; None where it is not given.

    source: of load_photo, whose place and time are read if that is asked for, and never otherwise.

    Raises:
        InputError: they are asked for and not all noted, or the sun was down. MissingExtra: without astral.
    """
    if given is None:
        return None
    said = read_sun(given)
    return sun_noted(_gps(source)) if said is None else said


def sun_noted(gps: dict[int, Any]) -> tuple[float, float]:
    """Return the sun's azimuth to the right of where a camera looked, and its height [degrees], by EXIF's GPS tags."""
    try:
        latitude, longitude = (
            float(np.dot(np.array(gps[tag], float), (1, 1 / 60, 1 / 3600))) * (-1 if gps[tag - 1] in "SW" else 1)
            for tag in (ExifTags.GPS.GPSLatitude, ExifTags.GPS.GPSLongitude)
        )
        hours, minutes, seconds = (int(one) for one in gps[ExifTags.GPS.GPSTimeStamp])
        day = datetime.strptime(gps[ExifTags.GPS.GPSDateStamp], "%Y:%m:%d")
        time = day.replace(hour=hours, minute=minutes, second=seconds, tzinfo=UTC)
        heading = float(gps[ExifTags.GPS.GPSImgDirection])
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        text = "expected a photo whose EXIF notes place, time and compass heading, got one that lacks some of them"
        raise InputError(text, subject="sun", remedy=give(sun="SIDE,HEIGHT")) from error
    try:
        from astral import Observer
        from astral.sun import azimuth, elevation
    except ImportError as error:
        raise MissingExtra("astral", "sun", "the sun's place by EXIF", error) from error
    place = Observer(latitude, longitude)
    height = elevation(place, time)
    if height < 0:
        text = f"expected a photo by day, got one whose EXIF puts the sun {-height:.0f} degrees below the horizon"
        raise InputError(text, subject="sun", remedy=give(sun="SIDE,HEIGHT"))
    return (azimuth(place, time) - heading + 180) % 360 - 180, height


def towards_sun(place: Sequence[float], up: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    """Return the unit direction towards the sun in the camera's frame.

    Args:
        place: azimuth to the right of where the camera looks, and height above the horizon [degrees]; or a direction.
        up: away from the ground, unit, camera frame.
    """
    if len(place) == 3:
        return np.asarray(place, float) / np.linalg.norm(place)
    azimuth, height = np.radians(place)
    right = np.cross([0.0, 0.0, -1.0], up)
    right /= max(float(np.linalg.norm(right)), 1e-6)
    level = np.cos(azimuth) * np.cross(up, right) + np.sin(azimuth) * right
    return np.cos(height) * level + np.sin(height) * up


def _gps(source: Any) -> dict[int, Any]:
    """Return EXIF's GPS tags of a photo's file, bytes or Pillow image; none where it has none."""
    try:
        if isinstance(source, bytes):
            source = open_picture(io.BytesIO(source))
        if isinstance(source, (str, os.PathLike)):
            with open_regular(source, InvalidPhoto, "an image file") as stream:
                return dict(open_picture(stream).getexif().get_ifd(ExifTags.IFD.GPSInfo))
        return dict(source.getexif().get_ifd(ExifTags.IFD.GPSInfo)) if isinstance(source, Image.Image) else {}
    except (UnknownPicture, ValueError, SyntaxError, OSError):  # as of damaged tags
        return {}
