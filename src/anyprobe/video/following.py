"""Follow the object's mask from frame to frame: from a folder, from a clip's transparency, or found once and moved with
the object (video.held_mask)."""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InputError, InvalidMask
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.surroundings import GivenPanorama, SurroundingsSource, asked_surroundings
from anyprobe.files.paths import visible_files
from anyprobe.inputs.hints import AUTO, NONE
from anyprobe.masks.check import object_box
from anyprobe.masks.networks import Network, load_network, shared_network
from anyprobe.masks.search import MARGIN, Looks, Prompts, choose
from anyprobe.notices import Remedy, give
from anyprobe.pictures.images import read_image
from anyprobe.video.clip import Frame
from anyprobe.video.held_mask import MOST_CHANGE, Held, follow, found_in, hold, lit_mask, mask_in
from anyprobe.video.registration import opencv
from anyprobe.video.track import digest_of

GROWTH = 0.08
"""Share by which the last mask's box is grown on each side to be the next prompt."""

ODD = 2
"""Frames after a lost object during which the picture before the loss is tried first."""

MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp")
DEPTH_SUFFIXES = (".png", ".tif", ".tiff", ".exr", ".npy")
HINT_SUFFIXES = {"mask": MASK_SUFFIXES, "depth": DEPTH_SUFFIXES, "normals": DEPTH_SUFFIXES}
"""Suffixes of files that belong to one frame each."""


class MaskFollower:
    """Turn frames, in order, into photos whose object is marked.

    hints: the caller's marks in the first frame; may be empty. segmenter: network that finds it; None: shared_network.
    last: x, y of a point well inside the last mask, that mask's pixels, and its box; None before the first.
    held: the mask that moves with the object; None if it has to be found.
    """

    def __init__(
        self,
        folders: Mapping[str, str | Path],
        hints: dict,
        every_frame: Mapping[str, Any],
        surroundings: SurroundingsSource | None = None,
    ) -> None:
        """folders: by keyword of load_photo ("mask", "depth", "normals"), each with one file a frame, sorted by name.

        hints: of load_photo, for the first frame: clicks and a box; and a segmenter, the network that finds it.
            every_frame: keywords of load_photo for every frame.
            surroundings: of load_photo, for every frame; a panorama is read once, here.
        """
        for kind, folder in folders.items():
            if not (isinstance(folder, str | os.PathLike) and os.path.isdir(folder)):
                raise InputError(f"expected a folder with one file for each frame, got {folder}", subject=kind)
        self._files = {kind: visible_files(Path(folder), HINT_SUFFIXES[kind]) for kind, folder in folders.items()}
        self.finds = not {"mask", "depth"} & self._files.keys()
        if hints and not self.finds:
            ways = (
                "mask" if "mask" in self._files else "depth",
                *(one for one in ("box", "click", "exclude", "segmenter") if one in hints),
            )
            raise InputError("expected one of them, got both", subject=ways)
        named = hints.get("segmenter")
        self.segmenter: Network | None = load_network(named) if isinstance(named, str) else named
        self.hints = hints
        around = asked_surroundings(surroundings)
        self._panorama = around if isinstance(around, GivenPanorama) else None
        word = NONE if self._panorama is not None else surroundings or AUTO
        self._every = {**every_frame, "surroundings": word}
        self.last: list[float] | None = None
        self.held: Held | None = None
        self._before: Held | None = None  # the mask that was held until the object was lost, _lost_for frames ago
        self._lost_for = 0
        self._is_seen = False  # whether the last frame gave a photo
        self._size: tuple[int, int] | None = None  # height and width of the last frame with an object

    @property
    def looks_same(self) -> bool:
        """Whether the last frame's object was found and looked as in the frames before, so that its light is theirs."""
        return self._is_seen and self.held is not None and self.held.looks_same

    def go_on(self, last: list[float] | None) -> None:
        """Continue from a saved run; the mask is found anew around the last box."""
        self.last, self.held, self._before = last, None, None

    def content(self) -> dict[str, Any]:
        """Return digests of the contents of files and surroundings, whatever their paths."""
        surroundings = self._every["surroundings"]
        if self._panorama is not None:
            surroundings = digest_of([self._panorama.values.tobytes()])
        files = {kind: digest_of(_bytes_of(path) for path in paths) for kind, paths in self._files.items()}
        return {"files": files, "surroundings": surroundings}

    def photo(self, frame: Frame) -> Photo:
        """Return the frame as a photo with its mask and what is known around it.

        Raises:
            InvalidMask: there is no mask, or the object is lost in this frame; a later one may show it again.
        """
        self._is_seen = False
        photo = self._marked(frame)
        self._is_seen = True
        return photo if self._panorama is None else replace(photo, surroundings=self._panorama)

    def _marked(self, frame: Frame) -> Photo:
        name = f"frame {frame.index}"
        own = {}
        for kind, paths in self._files.items():
            if frame.index >= len(paths):
                raise InvalidMask(f"expected one {kind} a frame, got {len(paths)} files; make the others", source=name)
            own[kind] = paths[frame.index]
        if not self.finds or (frame.alpha is not None and not self.hints):
            return self._load(frame, name, own)
        size = frame.rgb.shape[0], frame.rgb.shape[1]

        def lost(text: str, remedy: tuple[Remedy, ...] = ()) -> InvalidMask:
            return InvalidMask(text, code="no-object", source=name, remedy=remedy)

        if self._size is not None and self._size != size:
            raise lost(
                f"expected a frame of {self._size[1]} x {self._size[0]} pixels as before, got {size[1]} x {size[0]}, "
                "in which the object is lost; resize it, or begin another MaskFollower"
            )
        known = self.held, self._before, self._lost_for
        try:
            photo, whole = self._found(frame, name, own)
        except InvalidMask as error:
            if self.last is None or error.code != "no-object":
                raise
            x, y, count = self.last[:3]
            text = (
                f"expected the object of about {count:.0f} pixels near {x:.0f},{y:.0f}, found none there: it is lost "
            )
            raise lost(f"{text}in this frame, and looked for in the next", give("mask")) from error
        last = _last_of(whole)
        if self.last is not None and not 1 / MOST_CHANGE < last[2] / self.last[2] < MOST_CHANGE:
            self.held, self._before, self._lost_for = known
            first = "" if self.hints else "look at the first frame's mask, pass box= around the object there, or "
            raise lost(
                f"expected the object of about {self.last[2]:.0f} pixels at {self.last[0]:.0f},"
                f"{self.last[1]:.0f}, got {last[2]:.0f} pixels; {first}pass mask=, one file a frame"
            )
        self.last, self._size = last, size
        return photo

    def _found(self, frame: Frame, name: str, own: Mapping[str, Any]) -> tuple[Photo, np.ndarray]:
        """Return the photo and the whole mask [H, W], of which the photo's is a part; InvalidMask if there is none."""
        if (held := self._followed(frame.rgb)) is not None:
            photo = self._load(frame, name, own, mask=lit_mask(held, frame.rgb.shape))
            return replace(photo, mask_source="network"), mask_in(held, frame.rgb.shape)
        where = self.hints
        if self.last is not None:
            x, y, _, x0, y0, x1, y1 = self.last
            is_whole = (x1 - x0) * (y1 - y0) >= frame.rgb.shape[0] * frame.rgb.shape[1]
            where = {"click": [x, y]} if is_whole else {"click": [x, y], "box": (x0, y0, x1, y1)}
        photo = self._load(frame, name, own, **{**where, "segmenter": self.segmenter})
        whole = photo.mask
        self.held = hold(frame.rgb, whole)
        return replace(photo, mask=lit_mask(self.held, whole.shape)), whole

    def _followed(self, rgb: np.ndarray) -> Held | None:
        """Return the held mask where it is found again in a frame, else a new one; None if the object is lost."""
        if self.held is None or self.last is None:
            return None
        self._lost_for += 1
        if self._lost_for > ODD:
            self._before = None
        for held in (self._before, self.held):
            if held is None:
                continue
            found = found_in(held, rgb)
            if found is not None and found.is_sure:
                self._before = None if held is self._before else self._before
                self.held = follow(held, rgb, found)
                return self.held
        if (mask := _looked_for(rgb, self.last, self.segmenter)) is None:
            return None
        if self._before is None:
            self._before, self._lost_for = self.held, 0
        self.held = hold(rgb, mask)
        return self.held

    def _load(self, frame: Frame, name: str, own: Mapping[str, Any], **where: Any) -> Photo:
        """Return the frame's photo with its own files; errors name the frame or the file."""
        try:
            pixels = replace(read_image(frame.rgb, name), radiance=frame.radiance, alpha=frame.alpha)
            return load_photo(pixels, **self._every, **own, **where)
        except InputError as error:
            if not own or any(path.name in str(error) for path in own.values()):
                raise
            files = ", ".join(path.name for path in own.values())
            raise type(error)(f"{name} with {files}: {error}", code=error.code) from error


def _last_of(mask: np.ndarray) -> list[float]:
    """Return MaskFollower.last of a mask [H, W]."""
    (height, width), (x0, y0, x1, y1) = mask.shape, object_box(mask)
    right, down = GROWTH * (x1 - x0), GROWTH * (y1 - y0)
    box = max(x0 - right, 0), max(y0 - down, 0), min(x1 + right, width), min(y1 + down, height)
    return [*inner_point(mask), float(mask.sum()), *map(float, box)]


def _looked_for(rgb: np.ndarray, last: list[float], segmenter: Network | None) -> np.ndarray | None:
    """Return the mask [H, W] that the network finds around the last one's box; None if it finds nothing.

    last, segmenter: of MaskFollower.
    """
    height, width = rgb.shape[:2]
    x, y, _, x0, y0, x1, y1 = last
    prompts = Prompts(on=[(x, y)], box=(x0, y0, x1, y1))
    network = shared_network() if segmenter is None else segmenter
    looks = Looks(network, rgb.astype(np.float32) / 255.0)
    window = looks.photo.around((x0, y0, x1, y1), MARGIN)
    found = choose(window, looks.at(window, prompts), prompts)
    return None if found is None else found.mask(width, height)


def _bytes_of(path: Path) -> bytes:
    """Return a file's bytes; none if it cannot be read: the frame that needs it reports that."""
    with suppress(OSError):
        return path.read_bytes()
    return b""


def inner_point(mask: np.ndarray) -> tuple[float, float]:
    """Return x, y of the pixel of a mask [H, W] that is farthest from its edge; of several, the most central."""
    cv2, inside = opencv(), np.pad(mask > 0.5 if (mask > 0.5).any() else mask > 0, 1)
    distance = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L1, 3)
    rows, columns = np.nonzero(distance == distance.max())
    nearest = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    return float(columns[nearest] - 1), float(rows[nearest] - 1)
