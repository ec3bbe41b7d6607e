"""What iPhones note of how they were held."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest
from PIL import ExifTags, Image

from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.pictures.images import read_image

SIDES = {1: ((0, 1, 0), (-1, 0, 0)), 3: ((0, -1, 0), (1, 0, 0)), 6: ((-1, 0, 0), (0, -1, 0)), 8: ((1, 0, 0), (0, 1, 0))}


def note(acceleration, order: str = ">") -> bytes:
    """A maker's note with one other entry before the vector."""
    head = b"Apple iOS\0\0\1" + (b"MM" if order == ">" else b"II") + struct.pack(f"{order}H", 2)
    at = len(head) + 24
    entries = struct.pack(f"{order}HHIi", 1, 9, 1, 14) + struct.pack(f"{order}HHII", 8, 10, 3, at)
    numbers = [part for value in acceleration for part in (round(value * 1e6), 1_000_000)]
    return head + entries + struct.pack(f"{order}{len(numbers)}i", *numbers)


def photo(acceleration, orientation: int = 6, lens: str = "iPhone 15 back camera", order: str = ">") -> bytes:
    """A JPEG as a phone stores it: grey, with something in the middle."""
    pixels = np.full((240, 320, 3), 90, np.uint8) + np.arange(320, dtype=np.uint8)[:, None] // 2
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    more = exif.get_ifd(ExifTags.IFD.Exif)
    more[ExifTags.Base.MakerNote] = note(acceleration, order)
    more[ExifTags.Base.LensModel] = lens
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "JPEG", exif=exif)
    return stream.getvalue()


def held(pitch_deg: float, roll_deg: float, orientation: int) -> np.ndarray:
    """The accelerometer's vector: up, along the screen's left, its lower edge, and into it."""
    right, above, back = up_of(pitch_deg, roll_deg)
    across, upward = np.array(SIDES[orientation], float)
    return right * across + above * upward - back * np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize(("pitch", "roll"), [(25.0, 4.0), (-10.0, -7.0)])
def test_pitch_and_roll_are_those_of_the_hand(orientation, pitch, roll):
    found = read_image(photo(held(pitch, roll, orientation), orientation)).posture_deg
    assert found == pytest.approx((pitch, roll), abs=0.01)


def test_a_phone_upright_or_on_its_side_as_it_writes_it():
    assert read_image(photo((0.0, -1.0, 0.0), 6)).posture_deg == pytest.approx((0.0, 0.0), abs=0.01)
    assert read_image(photo((-1.0, 0.0, 0.0), 1)).posture_deg == pytest.approx((0.0, 0.0), abs=0.01)
    looking_down = read_image(photo((0.0, -0.8, -0.6), 6, order="<")).posture_deg  # the screen faces up
    assert looking_down == pytest.approx((36.87, 0.0), abs=0.01)


@pytest.mark.parametrize(
    "data",
    [
        photo((0.0, -1.4, 0.0)),  # shaken
        photo((0.0, -1.0, 0.0), 1),  # turned in an editor, the note kept
        photo((0.0, -1.0, 0.0), lens="iPhone 15 front TrueDepth camera"),
        photo((0.0, -1.0)),  # two numbers where three are said
        photo((0.0, -1.0, 0.0)).replace(b"Apple iOS", b"Other iOS"),
    ],
)
def test_what_is_not_sure_is_not_taken(data):
    assert read_image(data).posture_deg is None


def test_the_ground_is_the_camera_s_unless_a_pitch_is_given():
    mask = np.zeros((320, 240), np.float32)
    mask[120:260, 80:160] = 1
    data = photo(held(25.0, 4.0, 6))
    noted = load_photo(data, mask=mask, surroundings="photo").ground
    assert noted.source == "exif"
    assert (noted.pitch_deg, noted.roll_deg) == pytest.approx((25.0, 4.0), abs=0.01)
    given = load_photo(data, mask=mask, surroundings="photo", pitch_deg=12).ground
    assert (given.source, given.pitch_deg) == ("given", 12)
