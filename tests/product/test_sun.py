"""Where the sun stands, as it is said and as a photo notes it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image
from support.refused import refused

import anyprobe
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.sun_hint import towards_sun

EXAMPLES = Path(__file__).parents[2] / "examples"
GREENWICH = {
    ExifTags.GPS.GPSLatitudeRef: "N",
    ExifTags.GPS.GPSLatitude: (51.0, 28.0, 40.0),
    ExifTags.GPS.GPSLongitudeRef: "E",
    ExifTags.GPS.GPSLongitude: (0.0, 0.0, 0.0),
    ExifTags.GPS.GPSDateStamp: "2024:06:20",
    ExifTags.GPS.GPSTimeStamp: (12.0, 2.0, 0.0),
    ExifTags.GPS.GPSImgDirection: 90.0,
}
"""Noon of the summer solstice, looking east: the sun is in the south, 23.44 degrees north of the equator."""


def photo_with(gps: dict[int, object]) -> bytes:
    """The example as JPEG with these GPS tags."""
    with Image.open(EXAMPLES / "table.jpg") as image:
        exif, stream = Image.Exif(), io.BytesIO()
        exif.get_ifd(ExifTags.IFD.GPSInfo).update(gps)
        image.save(stream, "JPEG", exif=exif)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((0, 0), (0, 0, -1)),
        ((90, 0), (1, 0, 0)),
        ((-90, 30), (-(0.75**0.5), 0.5, 0)),
        ((180, 45), (0, 0.5**0.5, 0.5**0.5)),
    ],
)
def test_sides_are_those_of_a_level_camera(place, expected):
    np.testing.assert_allclose(towards_sun(place, np.array([0.0, 1.0, 0.0])), expected, atol=1e-12)
    assert towards_sun(place, up_of(35.0, 10.0)) @ up_of(35.0, 10.0) == pytest.approx(np.sin(np.radians(place[1])))


def test_a_direction_is_kept():
    np.testing.assert_allclose(towards_sun((0.0, 3.0, 4.0), up_of(20.0)), (0.0, 0.6, 0.8))


def test_exif_puts_the_sun_where_it_stood():
    pytest.importorskip("astral")
    given = {"mask": EXAMPLES / "table.png", "sun": "exif"}
    azimuth, height = load_photo(photo_with(GREENWICH), **given).sun
    assert azimuth == pytest.approx(90.0, abs=1.0)
    assert height == pytest.approx(90.0 - 51.478 + 23.44, abs=0.1)
    with refused("sun", naming="15 degrees below"):
        load_photo(photo_with({**GREENWICH, ExifTags.GPS.GPSTimeStamp: (0.0, 0.0, 0.0)}), **given)


@pytest.mark.parametrize("missing", [ExifTags.GPS.GPSImgDirection, ExifTags.GPS.GPSTimeStamp, ExifTags.GPS.GPSLatitude])
def test_exif_that_lacks_something_is_refused(missing):
    gps = {tag: value for tag, value in GREENWICH.items() if tag != missing}
    with refused("sun", naming="lacks some"):
        load_photo(photo_with(gps), mask=EXAMPLES / "table.png", sun="exif")


@pytest.mark.parametrize("sun", ["north", "left", "left,95", "0,0,0", (1.0,), "left,nan"])
def test_what_is_no_place_is_refused(sun):
    with refused("sun"):
        anyprobe.Hints(sun=sun)


def test_the_light_comes_from_where_the_sun_stands():
    given = {"mask": EXAMPLES / "table.png", "fov_deg": 60.0, "pitch_deg": 10.0}
    light = anyprobe.estimate(EXAMPLES / "table.jpg", **given, sun="left,40")
    d = light.dominant_light().direction
    assert np.degrees(np.arccos(d @ towards_sun((-90, 40), up_of(10.0)))) < 15
    assert light.info["hints"]["sun"] is True
    assert "sun" not in anyprobe.estimate(EXAMPLES / "table.jpg", **given).info["hints"]


def test_the_paper_s_model_refuses_it():
    with refused("sun", naming="paper"):
        anyprobe.estimate(EXAMPLES / "table.jpg", mask=EXAMPLES / "table.png", sun="left,30", model="paper")
