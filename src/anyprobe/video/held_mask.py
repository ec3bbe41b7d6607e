"""Hold an object's mask in the picture in which it was found, the key, and move it with the object to later frames.

**In every frame** the object is registered (video.registration) against the key, starting where it lay in the last
one; the mask is the key's, moved. While it is followed it is not searched again: each search finds a slightly different
mask, and the light would drift with it. If it is unsure, the mask is found anew in the frame, which becomes the key; if
the next frame fits the key before, the frame between was odd, and that key is restored.

**The key is replaced** by a frame in which it is found but is less alike than FADED.

**The object looks the same**, so that its light did not change, where it is found and 1 - alike is like that of the
last REMEMBERED frames (median): neither is over other_light.times the other and other_light.more. It falls where the
light changes back to that of the key.

**For the light** the mask is narrowed by `narrow` = NARROW of the longer side of its box, and NARROW_ERROR times the
error that registration expects of itself, at most NARROW_MOST pixels: its edge also shows what lies beside the object.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from PIL import Image

from anyprobe.core.contract import contract
from anyprobe.masks.check import object_box
from anyprobe.masks.search import Window
from anyprobe.video.registration import SEARCH_REACH, Key, Motion, Registered, begin_key, locate_key, luma, opencv

NUMBERS = contract("held_mask")
FADED: float = NUMBERS["faded"]
NARROW, NARROW_ERROR, NARROW_MOST = NUMBERS["narrow"], NUMBERS["narrow_error"], NUMBERS["narrow_most"]
MOST_CHANGE: float = NUMBERS["most_change"]
REMEMBERED, TIMES, MORE = NUMBERS["remembered"], NUMBERS["other_light"]["times"], NUMBERS["other_light"]["more"]
ROOM = NUMBERS["room"]
"""Margin of the key's window, in longer sides of the object."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Held:
    """A mask and the picture in which it is held, the key.

    offset: x, y of the first pixel of the key's window. cover: what is held there, [h, w]. motion: of the object from
    the key to the last frame, error_px: its expected error.
    unlike: 1 - alike of the last frames. looks_same: whether the last frame's object looks as in those before.
    """

    offset: tuple[int, int]
    cover: np.ndarray
    key: Key
    motion: Motion = Motion()
    error_px: float = 0.0
    unlike: tuple[float, ...] = ()
    looks_same: bool = False


def hold(rgb: np.ndarray, mask: np.ndarray) -> Held:
    """Return a mask [H, W] that was found in a frame [H, W, 3] uint8."""
    height, width = mask.shape
    window = Window(x0=0, y0=0, x1=width, y1=height).around(object_box(mask), ROOM)
    inside = slice(window.y0, window.y1), slice(window.x0, window.x1)
    cover, offset = mask[inside].astype(np.float32), (window.x0, window.y0)
    return Held(offset=offset, cover=cover, key=begin_key(luma(rgb[inside]), cover, offset))


def found_in(held: Held, rgb: np.ndarray) -> Registered:
    """Return the object's motion in another frame, searched around its last place."""
    height, width = rgb.shape[:2]
    x0, y0, x1, y1 = _box(held)
    more = (SEARCH_REACH + 0.1) * max(x1 - x0, y1 - y0)
    window = Window(x0=0, y0=0, x1=width, y1=height).around((x0 - more, y0 - more, x1 + more, y1 + more), 0.0)
    if window.x1 - window.x0 < 8 or window.y1 - window.y0 < 8:
        return Registered(motion=held.motion)
    picture = luma(rgb[window.y0 : window.y1, window.x0 : window.x1])
    return locate_key(held.key, picture, held.motion, (window.x0, window.y0))


def follow(held: Held, rgb: np.ndarray, found: Registered) -> Held:
    """Return the state after one more frame, in which the object was surely `found`."""
    usual = float(np.median(held.unlike)) if held.unlike else 1.0 - found.alike
    unlike, own = (*held.unlike, 1.0 - found.alike)[-REMEMBERED:], 1.0 - found.alike
    looks_same = max(own, usual) <= TIMES * min(own, usual) + MORE
    now = replace(held, motion=found.motion, error_px=found.error_px, unlike=unlike, looks_same=looks_same)
    if found.alike >= FADED:
        return now
    newer = hold(rgb, mask_in(now, rgb.shape))
    return replace(now, offset=newer.offset, cover=newer.cover, key=newer.key, motion=newer.motion)


def mask_in(held: Held, shape: tuple[int, ...], cover: np.ndarray | None = None) -> np.ndarray:
    """Return the mask [H, W] float32 in the last frame, of that shape; cover: another one of the key's."""
    cover = held.cover if cover is None else cover
    height, width = shape[:2]
    mask = np.zeros((height, width), np.float32)
    x0, y0, x1, y1 = (int(round(v)) for v in _box(held))
    x0, y0, x1, y1 = max(x0 - 2, 0), max(y0 - 2, 0), min(x1 + 2, width), min(y1 + 2, height)
    if x0 >= x1 or y0 >= y1:
        return mask
    key, motion = held.key, held.motion
    back = np.linalg.inv(motion.matrix())
    first = back @ (np.array([x0 - motion.x, y0 - motion.y]) - key.center) + key.center - held.offset
    image, affine = Image.fromarray(np.ascontiguousarray(cover, np.float32)), (*back[0], first[0], *back[1], first[1])
    size = x1 - x0, y1 - y0
    mask[y0:y1, x0:x1] = np.asarray(image.transform(size, Image.Transform.AFFINE, affine, Image.Resampling.BILINEAR))
    return mask


def lit_mask(held: Held, shape: tuple[int, ...]) -> np.ndarray:
    """Return the mask in the last frame, narrowed for the estimate of light."""
    x0, y0, x1, y1 = object_box(held.cover)
    narrow = NARROW * max(x1 - x0, y1 - y0) + NARROW_ERROR * held.error_px
    cover = narrowed(held.cover, min(narrow, NARROW_MOST))
    return mask_in(held, shape, cover if (cover > 0.5).any() else held.cover)


def narrowed(cover: np.ndarray, pixels: float) -> np.ndarray:
    """Return a cover [h, w] whose edge lies so many pixels further inside.

    The minimum over four neighbours, zero beyond the border, is repeated; for a fraction, the last two are averaged.
    """
    cv2, whole = opencv(), int(pixels)
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    erode = partial(cv2.erode, cover, cross, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    larger, smaller = (erode(iterations=count) for count in (whole, whole + 1))
    return larger + np.float32(pixels - whole) * (smaller - larger)


def _box(held: Held) -> tuple[float, float, float, float]:
    """Return the box of the held object in the last frame: left, top, right, bottom [px]."""
    x0, y0, x1, y1 = object_box(held.cover)
    corners = np.array([[x0, y0], [x1, y0], [x0, y1], [x1, y1]]) + held.offset - held.key.center
    places = corners @ held.motion.matrix().T + held.key.center + (held.motion.x, held.motion.y)
    left, top = places.min(axis=0)
    right, bottom = places.max(axis=0)
    return float(left), float(top), float(right), float(bottom)
