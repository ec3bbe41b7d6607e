"""Where the pixels that a file stores are in the picture that it shows, which may be turned, mirrored or made square.

Clicks, boxes and masks are in pixels as shown; some programs count them as stored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image

from anyprobe.files.exr import parse_header

TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
"""What brings a picture upright, by EXIF's orientation."""

_STEPS = {
    1: (False, False, False),
    2: (False, True, False),
    3: (False, True, True),
    4: (False, False, True),
    5: (True, False, False),
    6: (True, True, False),
    7: (True, True, True),
    8: (True, False, True),
}
"""The same as: columns and rows changed about; then mirrored left to right; then top to bottom."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StoredPixels:
    """How pixels as stored become those shown.

    size, shown: width and height. transposed: columns and rows are changed about; mirrored_x, mirrored_y: what is
    shown is mirrored then.
    """

    size: tuple[int, int]
    shown: tuple[int, int]
    transposed: bool = False
    mirrored_x: bool = False
    mirrored_y: bool = False

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Where x, y of the stored pixels is in those shown."""
        u, v = x / self.size[0], y / self.size[1]
        if self.transposed:
            u, v = v, u
        u, v = 1 - u if self.mirrored_x else u, 1 - v if self.mirrored_y else v
        return u * self.shown[0], v * self.shown[1]

    def box(self, box: Sequence[float]) -> tuple[float, float, float, float]:
        """The same of x0, y0, x1, y1."""
        (x0, x1), (y0, y1) = (sorted(pair) for pair in zip(self.point(*box[:2]), self.point(*box[2:]), strict=True))
        return x0, y0, x1, y1

    def or_none(self) -> StoredPixels | None:
        """None where nothing changes."""
        moved = self.transposed or self.mirrored_x or self.mirrored_y or self.size != self.shown
        return self if moved else None


def stored_by_exif(orientation: int, size: tuple[int, int], shown: tuple[int, int]) -> StoredPixels | None:
    """Of a picture of these widths and heights with EXIF's orientation; None where it is upright as it is."""
    transposed, mirrored_x, mirrored_y = _STEPS.get(orientation, _STEPS[1])
    if shown != (size[::-1] if transposed else size):  # it could not be turned
        return None
    found = StoredPixels(size=size, shown=shown, transposed=transposed, mirrored_x=mirrored_x, mirrored_y=mirrored_y)
    return found.or_none()


def stored_by_exr(data: bytes, shown: tuple[int, int]) -> StoredPixels | None:
    """Of an OpenEXR file that could be read; None where its pixels are square."""
    low, high = parse_header(data).display
    width, height = (high - low).tolist()
    return StoredPixels(size=(width, height), shown=shown).or_none()
