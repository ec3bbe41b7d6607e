"""Our own network finds the object: from a click, a box or no prompt, at 160 pixels across."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np

from anyprobe.errors import ModelError
from anyprobe.files.graphs import open_graph
from anyprobe.masks.prompts import BOX_LEVEL, CLICK_SIGMA_PX, Point, draw_prompts
from anyprobe.masks.refine import resize
from anyprobe.masks.regions import grow, label_parts

SIZE = 160
"""Side of the network's input and output."""

GREY = 0.5
"""What fills the square beside the photo."""

CONTRACT = {
    "contract": "1",
    "stage": "mask",
    "input": "display RGB in [0, 1] of the whole photo, longer side 160, centred, 0.5 beside it; hint channel",
    "hint": f"box {BOX_LEVEL}, clicks +1 and -1, Gaussian of sigma {CLICK_SIGMA_PX:g} px",
}
"""Metadata that the graph carries; another value means other conventions, and is refused."""

AGAIN_BELOW = 0.6
"""An object whose longer side is less than this share of the photo's is looked at again, closer."""

AGAIN_SIDE = 1.7
"""Side of that second look in the object's longer sides."""

PART_SHARE = 0.2
"""Loose parts below this share of the largest are dropped."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Proposal:
    """cover [h, w] in [0, 1], the photo's extent at the network's resolution or finer; confidence: the IoU
    that the network itself expects, in [0, 1]; 0 where nothing was found."""

    cover: np.ndarray
    confidence: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Letterbox:
    """A window of a photo in the network's square. origin x, y and size w, h of the window in the photo's
    pixels; the square's pixels inside it: left, top, width, height."""

    origin: tuple[int, int]
    size: tuple[int, int]
    left: int
    top: int
    width: int
    height: int

    @classmethod
    def around(cls, origin: tuple[int, int], size: tuple[int, int]) -> Letterbox:
        """Longer side SIZE, centred."""
        scale = SIZE / max(size)
        width, height = (min(SIZE, max(1, round(length * scale))) for length in size)
        return cls(
            origin=origin, size=size, left=(SIZE - width) // 2, top=(SIZE - height) // 2, width=width, height=height
        )

    def square(self, rgb: np.ndarray) -> np.ndarray:
        """The window of the photo [H, W, 3] in the square, [SIZE, SIZE, 3]."""
        x, y = self.origin
        window = rgb[y : y + self.size[1], x : x + self.size[0]]
        square = np.full((SIZE, SIZE, 3), GREY, np.float32)
        rows, columns = self._inside()
        square[rows, columns] = resize(window, self.width, self.height)
        return square

    def cut(self, square: np.ndarray) -> np.ndarray:
        """What of a picture [SIZE, SIZE] lies on the window."""
        return square[self._inside()]

    def point(self, x: float, y: float) -> Point:
        """A point of the photo in the square."""
        across, down = self.width / self.size[0], self.height / self.size[1]
        return self.left + (x - self.origin[0]) * across, self.top + (y - self.origin[1]) * down

    def _inside(self) -> tuple[slice, slice]:
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)


class MaskNetwork:
    """The graph, opened once; safe to share between threads."""

    def __init__(self, path: str | Path | None = None) -> None:
        path = default_graph() if path is None else Path(path)
        if not path.is_file():
            raise ModelError(f"{path}: the mask network is missing; reinstall anyprobe")
        self._session = open_graph(path)
        found = self._session.get_modelmeta().custom_metadata_map
        for key, value in CONTRACT.items():
            if found.get(key) != value:
                raise ModelError(
                    f"{path.name}: expected {key} = {value!r}, got {found.get(key)!r}; use weights of this version"
                )

    def cover(self, square: np.ndarray, hint: np.ndarray) -> np.ndarray:
        """Cover [SIZE, SIZE] of a letterboxed photo [SIZE, SIZE, 3] and its hint channel [SIZE, SIZE]."""
        image = np.concatenate([square.transpose(2, 0, 1), hint[None]])[None]
        return self._session.run(None, {"input": np.ascontiguousarray(image, np.float32)})[0][0, 0]

    def propose(
        self,
        rgb: np.ndarray,
        on: Sequence[Point] = (),
        off: Sequence[Point] = (),
        box: Sequence[float] | None = None,
        again: bool = True,
    ) -> Proposal:
        """The object of a photo [H, W, 3].

        Args:
            on, off: clicks x, y on the object and beside it, in pixels; box: x0, y0, x1, y1 around it.
            again: look at a small object a second time, closer.
        """
        height, width = rgb.shape[:2]
        whole = Letterbox.around((0, 0), (width, height))
        first = self.look(rgb, whole, on, off, box)
        found = object_window(first.cover, width, height)
        if not again or found is None or max(found[2:]) >= AGAIN_BELOW * max(width, height):
            return first
        window = square_around(found, width, height)
        seen = (found[0], found[1], found[0] + found[2], found[1] + found[3])
        given = bool(on) or box is not None
        closer = self.look(rgb, window, on, off, box if given else seen)
        if closer.confidence < first.confidence:
            return first
        return Proposal(cover=_paste(closer.cover, window, width, height), confidence=closer.confidence)

    def look(self, rgb, window: Letterbox, on, off, box) -> Proposal:
        """One run of the network on a window; cover of the window's extent."""
        corners = None if box is None else (*window.point(*box[:2]), *window.point(*box[2:]))
        hint = draw_prompts(SIZE, [window.point(*p) for p in on], [window.point(*p) for p in off], box=corners)
        cover = window.cut(self.cover(window.square(rgb), hint))
        kept = cover * keep_large_parts(cover > 0.5)
        return Proposal(cover=kept, confidence=_confidence(cover, kept > 0.5))


def as_proposal(cover: np.ndarray) -> Proposal:
    """Another segmenter's cover [H, W] in [0, 1], with the IoU that it expects by itself."""
    return Proposal(cover=cover, confidence=_confidence(cover, cover > 0.5))


@lru_cache(maxsize=1)
def shared_network() -> MaskNetwork:
    """The bundled network, opened at the first call."""
    return MaskNetwork()


def default_graph() -> Path:
    """Where the bundled network lies."""
    return Path(str(resources.files("anyprobe") / "weights" / "mask" / "mask.onnx"))


def keep_large_parts(inside: np.ndarray) -> np.ndarray:
    """The mask [h, w] bool without loose parts (4-connected) below PART_SHARE of the largest, grown by a pixel."""
    labels, sizes = label_parts(inside)
    large = sizes >= PART_SHARE * sizes[1:].max(initial=0)
    large[0] = False
    return grow(large[labels])


def _confidence(cover: np.ndarray, inside: np.ndarray) -> float:
    """Expected IoU of the mask `inside` where cover is each pixel's probability."""
    if not inside.any():
        return 0.0
    return float(cover[inside].sum() / (inside.sum() + cover[~inside].sum()))


def object_window(cover: np.ndarray, width: int, height: int) -> tuple[float, float, float, float] | None:
    """x, y, w, h of cover > 0.5 in the photo's pixels."""
    inside = cover > 0.5
    if not inside.any():
        return None
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    across, down = width / cover.shape[1], height / cover.shape[0]
    x, y = columns[0] * across, rows[0] * down
    return x, y, (columns[-1] + 1) * across - x, (rows[-1] + 1) * down - y


def square_around(found: tuple[float, float, float, float], width: int, height: int) -> Letterbox:
    """AGAIN_SIDE times the longer side of x, y, w, h around its centre, moved into the photo."""
    side = AGAIN_SIDE * max(found[2:])
    centre = found[0] + found[2] / 2, found[1] + found[3] / 2
    spans = []
    for middle, length in zip(centre, (width, height), strict=True):
        extent = min(length, max(1, round(side)))
        spans.append((int(np.clip(round(middle - extent / 2), 0, length - extent)), extent))
    (x, w), (y, h) = spans
    return Letterbox.around((x, y), (w, h))


def _paste(cover: np.ndarray, window: Letterbox, width: int, height: int) -> np.ndarray:
    """The window's cover in the photo's extent, at the window's resolution or the photo's, if that is coarser."""
    fine = min(1.0, max(cover.shape) / max(window.size))
    canvas = np.zeros((max(1, round(height * fine)), max(1, round(width * fine))), np.float32)
    across, down = canvas.shape[1] / width, canvas.shape[0] / height
    x0, y0 = round(window.origin[0] * across), round(window.origin[1] * down)
    x1 = min(canvas.shape[1], x0 + max(1, round(window.size[0] * across)))
    y1 = min(canvas.shape[0], y0 + max(1, round(window.size[1] * down)))
    canvas[y0:y1, x0:x1] = resize(cover, x1 - x0, y1 - y0)
    return canvas
