"""Apple's maker note in EXIF: signed rationals by tag, among them the direction of gravity.

Tags and axes: ExifTool, Image::ExifTool::Apple. The accelerometer's vector is in units of g along the screen's left,
the screen's lower edge, and into the screen; of a phone at rest it is upward.
"""

from __future__ import annotations

import struct

import numpy as np
from PIL import ExifTags, Image

_NOTE = b"Apple iOS\0"
_FIRST_ENTRY = 16
_SIGNED_RATIONAL = 10
_ACCELERATION = 8
MOST_ENTRIES, MOST_NUMBERS = 500, 16
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
        note = bytes(image.getexif().get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.MakerNote, b""))
        return _numbers(note)
    except Exception:  # its parser raises whatever the bad bytes lead it to
        return {}


def apple_posture_deg(image: Image.Image) -> tuple[float, float] | None:
    """Return the camera's pitch downwards and its roll [degrees], see estimate.ground.Ground; None where unknown.

    Known for the rear camera of a phone at rest, in a picture that is shown upright.
    """
    acceleration = apple_numbers(image).get(_ACCELERATION, ())
    if len(acceleration) != 3:
        return None
    try:
        exif = image.getexif()
        axes = _UPRIGHT.get(int(exif.get(ExifTags.Base.Orientation, 1)))
        lens = str(exif.get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.LensModel, ""))
    except Exception:  # as in apple_numbers
        return None
    up = np.array(acceleration)
    if axes is None or "front" in lens.lower() or not AT_REST[0] <= np.linalg.norm(up) <= AT_REST[1]:
        return None
    right, above = (float(up @ axis) for axis in np.array(axes))
    pitch = np.degrees(np.arctan2(-up[2], np.hypot(right, above)))
    roll = np.degrees(np.arctan2(right, above))
    return (float(pitch), float(roll)) if abs(roll) <= MOST_ROLL_DEG else None


def _numbers(note: bytes) -> dict[int, tuple[float, ...]]:
    if not note.startswith(_NOTE):
        return {}
    order = "<" if note[12:14] == b"II" else ">"
    (count,) = struct.unpack_from(f"{order}H", note, _FIRST_ENTRY - 2)
    found = {}
    for k in range(min(count, MOST_ENTRIES)):
        tag, kind, length, at = struct.unpack_from(f"{order}HHII", note, _FIRST_ENTRY + 12 * k)
        if kind == _SIGNED_RATIONAL and 1 <= length <= MOST_NUMBERS:
            numbers = struct.unpack_from(f"{order}{2 * length}i", note, at)
            pairs = zip(numbers[::2], numbers[1::2], strict=True)
            found[tag] = tuple(above / below if below else 0.0 for above, below in pairs)
    return found
