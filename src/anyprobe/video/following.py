"""The object's mask from frame to frame: from a folder, or found anew around a point of the last one.

Each frame's mask owes nothing to the last one's edge, so that no error grows from frame to frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InputError, InvalidMask
from anyprobe.estimate.known import Panorama
from anyprobe.estimate.photo import Photo, load_photo, object_box
from anyprobe.estimate.surroundings import SurroundingsSource, read_surroundings
from anyprobe.files.digests import digest_of
from anyprobe.files.images import read_image
from anyprobe.files.paths import visible_files
from anyprobe.hints import AUTO, NONE, PHOTO
from anyprobe.masks.depth import CARRIED, is_carried
from anyprobe.masks.networks import shared_network
from anyprobe.masks.resize import resize
from anyprobe.masks.search import MARGIN, Prompts, Window, choose, look
from anyprobe.video.clip import Frame

GROWTH = 0.08
"""The box prompt is the last mask's, grown by this share on every side."""

MOST_CHANGE = 1.4
"""An object that is so many times larger or smaller than in the last frame is another."""

ANEW = 8
"""Every so many frames the mask is found anew, by one look around the last one; between, it moves with the picture."""

_SIDE = 128
"""Of the window around the object that is compared from frame to frame."""

ROOM = 0.25
"""Of that window on every side, in the longer sides of the object; what moves further is looked for."""

ALIKE = 0.8
"""Correlation of the moved object with itself where its mask was found, below which that is found anew."""

COARSE_PX = 128
"""Longer side of the mask that the inner point is looked for in."""

MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp")
DEPTH_SUFFIXES = (".png", ".tif", ".tiff", ".exr", ".npy")
HINT_SUFFIXES = {"mask": MASK_SUFFIXES, "depth": DEPTH_SUFFIXES, "normals": DEPTH_SUFFIXES}
"""Suffixes of the files of one frame each."""


class MaskFollower:
    """Frames in order become photos whose object is marked.

    hints: what the caller said about the first frame; may be empty. last: x, y of a point well
    inside the last mask, that mask's pixels, and its box; None before the first.
    """

    def __init__(
        self,
        folders: Mapping[str, Path | None],
        hints: dict,
        every_frame: Mapping[str, Any],
        surroundings: SurroundingsSource | None = None,
    ) -> None:
        """folders: of one file a frame, sorted by name, by the keyword of load_photo ("mask", "depth", "normals").

        hints: of load_photo, for the first frame: clicks and a box. every_frame: of load_photo, for every frame.
        surroundings: of load_photo, for every frame; a panorama is read here, once.
        """
        if is_carried(every_frame.get("depth")):
            text = f"expected a folder with one file for each frame, got {CARRIED}, which clips lack"
            raise InputError(text, subject="depth")
        given = {kind: folder for kind, folder in folders.items() if folder is not None}
        for kind, folder in given.items():
            if not folder.is_dir():
                raise InputError(f"expected a folder with one file for each frame, got {folder}", subject=kind)
        self._files = {kind: visible_files(folder, HINT_SUFFIXES[kind]) for kind, folder in given.items()}
        cut = {"near", "far"} & {name for name, value in every_frame.items() if value is not None}
        self.finds = "mask" not in self._files and not ("depth" in self._files and cut)
        if hints and not self.finds:
            ways = (
                "mask" if "mask" in self._files else "depth",
                *(one for one in ("box", "click", "exclude") if one in hints),
            )
            raise InputError("expected one of them, got both", subject=ways)
        self.hints = hints
        self._panorama: np.ndarray | None = None  # [64, 128, 4 or 5], see estimate.surroundings
        word = NONE
        if surroundings is None or (isinstance(surroundings, str) and surroundings in (AUTO, PHOTO, NONE)):
            word = surroundings or AUTO
        else:
            self._panorama = read_surroundings(surroundings, above_white=True)
        self._every = {**every_frame, "surroundings": word}
        self.last: list[float] | None = None
        self._seen: Seen | None = None

    def look_anew(self) -> None:
        """The next mask is looked for, not moved from the last frame's: what is not kept must not matter later."""
        self._seen = None

    def content(self) -> dict[str, Any]:
        """What files and surroundings hold, wherever they lie: a digest each, or a word."""
        surroundings = self._every["surroundings"]
        if self._panorama is not None:
            surroundings = digest_of([self._panorama.tobytes()])
        files = {kind: digest_of(_bytes_of(path) for path in paths) for kind, paths in self._files.items()}
        return {"files": files, "surroundings": surroundings}

    def photo(self, frame: Frame) -> Photo:
        """The frame as a photo with its mask and what is known around it; InvalidMask where there is no mask."""
        photo = self._marked(frame)
        return photo if self._panorama is None else replace(photo, surroundings=Panorama(small=self._panorama))

    def _marked(self, frame: Frame) -> Photo:
        name = f"frame {frame.index}"
        own = {}
        for kind, paths in self._files.items():
            if frame.index >= len(paths):
                raise InvalidMask(f"{name}: expected one {kind} a frame, got {len(paths)} files; make the others")
            own[kind] = paths[frame.index]
        if not self.finds:
            return self._load(frame, name, own)
        where = self.hints if self.last is None else _prompts_from(self.last, frame.rgb.shape)
        photo = self._quickly(frame, name, own) or self._load(frame, name, own, **where)
        pixels = float(photo.mask.sum())
        if self.last is not None and not 1 / MOST_CHANGE < pixels / self.last[2] < MOST_CHANGE:
            first = "" if self.hints else "look at the first frame's mask, pass box= around the object there, or "
            raise InvalidMask(
                f"{name}: expected the object of about {self.last[2]:.0f} pixels at {self.last[0]:.0f},"
                f"{self.last[1]:.0f}, got {pixels:.0f} pixels; {first}pass mask=, one file a frame"
            )
        self.last = [*inner_point(photo.mask), pixels, *_grown_box(photo.mask)]
        return photo

    def _quickly(self, frame: Frame, name: str, own: Mapping[str, Path]) -> Photo | None:
        """The photo by the last mask, moved or looked for around where it was; None where it has to be found."""
        if self.last is None or "segmenter" in self.hints:
            return None
        mask = None
        if frame.index % ANEW and self._seen is not None:
            mask = self._seen.moved(frame.rgb)
        if mask is None:
            mask = _looked_for(frame.rgb, self.last)
            self._seen = None if mask is None else Seen(frame.rgb, mask)
        if mask is None:
            return None
        return replace(self._load(frame, name, own, mask=mask), mask_source="network")

    def _load(self, frame: Frame, name: str, own: Mapping[str, Any], **where: Any) -> Photo:
        """The frame with files of its own; errors say which frame, or which of its files."""
        try:
            pixels = replace(read_image(frame.rgb, name), radiance=frame.radiance)
            return load_photo(pixels, **self._every, **own, **where)
        except InputError as error:
            if not own or any(path.name in str(error) for path in own.values()):
                raise
            files = ", ".join(path.name for path in own.values())
            raise type(error)(f"{name} with {files}: {error}") from error


def _looked_for(rgb: np.ndarray, last: list[float]) -> np.ndarray | None:
    """The mask by one look at the last one's box and a margin, [H, W]; None where nothing is there.

    last: of MaskFollower.
    """
    height, width = rgb.shape[:2]
    x, y, _, x0, y0, x1, y1 = last
    prompts = Prompts(on=[(x, y)], box=(x0, y0, x1, y1))
    window = Window(x0=0, y0=0, x1=width, y1=height).around((x0, y0, x1, y1), MARGIN)
    cover = look(shared_network(), rgb.astype(np.float32) / 255.0, window, prompts)
    found = choose(window, cover, prompts)
    return None if found is None else found.mask(width, height)


def _prompts_from(last: list[float], shape: tuple[int, ...]) -> dict:
    x0, y0, x1, y1 = last[3:]
    whole = (x1 - x0) * (y1 - y0) >= shape[0] * shape[1]
    return {"click": last[:2]} if whole else {"click": last[:2], "box": (x0, y0, x1, y1)}


class Seen:
    """What a frame [H, W, 3] uint8 shows in a window around its object, whose mask is [H, W]."""

    def __init__(self, rgb: np.ndarray, mask: np.ndarray) -> None:
        self.mask = mask
        height, width = mask.shape
        self.window = Window(x0=0, y0=0, x1=width, y1=height).around(object_box(mask), ROOM)
        window = self.window
        cover = resize(mask[window.y0 : window.y1, window.x0 : window.x1], _SIDE, _SIDE) > 0.5
        tile = self._tile_of(rgb)
        self._cover = cover.astype(np.float64)
        self._object = self._cover * (tile - tile[cover].mean() if cover.any() else tile)

    def moved(self, rgb: np.ndarray) -> np.ndarray | None:
        """The mask where its object is in another frame of the same size: by the shift at which what it covers
        correlates most (Padfield 2012); None where that is not alike."""
        tile, count = self._tile_of(rgb), float(self._cover.sum())
        spectrum = np.fft.rfft2(np.stack([tile, tile**2]))
        cover, object_ = np.conj(np.fft.rfft2(np.stack([self._cover, self._object])))
        agree, total, square = np.fft.irfft2(
            [spectrum[0] * object_, spectrum[0] * cover, spectrum[1] * cover], (_SIDE, _SIDE)
        )
        spread = np.sqrt(np.maximum(square - total**2 / count, 1e-6) * max(float((self._object**2).sum()), 1e-6))
        shifts = (np.arange(_SIDE) + _SIDE // 2) % _SIDE - _SIDE // 2
        near = abs(shifts) <= _SIDE * ROOM / (1 + 2 * ROOM)
        alike = np.where(np.outer(near, near), agree / spread, -1.0)
        row, column = np.unravel_index(alike.argmax(), alike.shape)
        if alike[row, column] < ALIKE:
            return None
        down, across = shifts[row], shifts[column]
        x, y = (round(shift * length / _SIDE) for shift, length in zip((across, down), self.window.size, strict=True))
        height, width = self.mask.shape
        moved = np.zeros_like(self.mask)
        moved[max(0, y) : height + min(0, y), max(0, x) : width + min(0, x)] = self.mask[
            max(0, -y) : height - max(0, y), max(0, -x) : width - max(0, x)
        ]
        return moved

    def _tile_of(self, rgb: np.ndarray) -> np.ndarray:
        """Green of the window, [_SIDE, _SIDE]."""
        window = self.window
        green = rgb[window.y0 : window.y1, window.x0 : window.x1, 1]
        return resize(green.astype(np.float32), _SIDE, _SIDE).astype(np.float64)


def _bytes_of(path: Path) -> bytes:
    """A file's; none of one that cannot be read, which the frame that asks for it names."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _grown_box(mask: np.ndarray) -> list[float]:
    height, width = mask.shape
    x0, y0, x1, y1 = object_box(mask)
    right, down = GROWTH * (x1 - x0), GROWTH * (y1 - y0)
    return [float(v) for v in (max(x0 - right, 0), max(y0 - down, 0), min(x1 + right, width), min(y1 + down, height))]


def inner_point(mask: np.ndarray) -> tuple[float, float]:
    """x, y of a pixel far from the edge of a mask [H, W] that is not empty; of several the most central."""
    step = max(1, -(-max(mask.shape) // COARSE_PX))
    inside = mask[step // 2 :: step, step // 2 :: step] > 0.5
    if not inside.any():
        inside, step = mask > 0, 1
    left = inside
    while left.any():
        inside, padded = left, np.pad(left, 1)
        left = left & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    rows, columns = np.nonzero(inside)
    nearest = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    return float(columns[nearest] * step + step // 2), float(rows[nearest] * step + step // 2)
