"""The object's mask from frame to frame: from a folder, or found once and then followed by GrabCut."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError, InvalidMask
from anyprobe.infer.photo import Photo, load_photo, object_box
from anyprobe.video.clip import Frame

GROWTH = 0.12
"""The object of the last frame is looked for in its box, grown by this share on every side."""

MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp")


class MaskFollower:
    """Frames in order become photos whose object is marked.

    told: what the caller said about the first frame; may be empty. box: where the next frame's object
    is looked for, None before the first.
    """

    def __init__(self, masks: Path | None, where: dict, fov_deg: float | None) -> None:
        """masks: a folder of one mask a frame, sorted by name. where: of load_photo, for the first frame."""
        self._files: list[Path] | None = None
        if masks is not None:
            if not masks.is_dir():
                raise InputError(f"{masks}: expected a folder with one mask for each frame, got none")
            self._files = sorted(path for path in masks.iterdir() if path.suffix.lower() in MASK_SUFFIXES)
        self.told, self._fov_deg = where, fov_deg
        self.box: Sequence[float] | None = None

    def photo(self, frame: Frame) -> Photo:
        """The frame as a photo with its mask; InvalidMask where there is none."""
        name = f"frame {frame.index}"
        if self._files is not None:
            if frame.index >= len(self._files):
                raise InvalidMask(
                    f"{name}: expected one mask a frame, got {len(self._files)} masks; make the others"
                )
            return load_photo(frame.rgb, mask=self._files[frame.index], fov_deg=self._fov_deg)
        where = self.told if self.box is None else {"box": self.box}
        photo = load_photo(frame.rgb, fov_deg=self._fov_deg, **where)
        self.box = self._grown(photo.mask)
        return photo

    @staticmethod
    def _grown(mask: np.ndarray) -> tuple[int, int, int, int]:
        height, width = mask.shape
        x0, y0, x1, y1 = object_box(mask)
        right, down = round(GROWTH * (x1 - x0)) + 2, round(GROWTH * (y1 - y0)) + 2
        return max(x0 - right, 0), max(y0 - down, 0), min(x1 + right, width), min(y1 + down, height)
