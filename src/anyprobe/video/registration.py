"""Find the object of one picture, the key, in another one: a similarity, by OpenCV.

A place p of the key lies in the picture at W(p) = c + (x, y) + e^scale R(angle) (p - c), x right, y down, with c the
mean of the mask's pixels. The whole object is matched first, then aligned to a fraction of a pixel by the
enhanced correlation coefficient (Evangelidis and Psarakis, 2008), which does not depend on exposure: by a shift; by a
turn and by an affine map (then its nearest similarity) too, if these explain much more. A moving light changes the
shading, which must not be taken for a motion.
"""

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from anyprobe.errors import optional

FINE_PX, COARSE_PX = 192, 32
"""Longer side of the object [pixels] for aligning, and for the first search."""
SEARCH_REACH = 0.25
"""Reach of the search, in longer sides of the object."""
PULL = 0.05
"""Loss of correlation at the end of that reach, so that the nearer of two matches wins."""
ROUNDS, DONE = 40, 1e-4
"""Most rounds of the alignment, and the gain of correlation at which it stops. Nothing is smoothed: that would mix what
lies beside the object into it."""
FEWER = 0.5
"""Share of the unexplained correlation that a motion with more parameters may leave."""
LEAST_AREA = 0.1
"""Least area of the object, as a share of that in the key."""
ALIKE, INSIDE = 0.8, 0.7
"""Correlation, and share of the object in the picture, from which a motion is sure."""
ERROR = 3.0
"""Sigmas of the stated error of the outline."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion:
    """x, y: shift in pixels. angle: radians, clockwise as seen. scale: natural logarithm."""

    x: float = 0.0
    y: float = 0.0
    angle: float = 0.0
    scale: float = 0.0

    def matrix(self) -> np.ndarray:
        """[2, 2] e^scale R(angle)."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.exp(self.scale) * np.array([[cos, -sin], [sin, cos]])


@dataclass(frozen=True, kw_only=True, slots=True)
class Registered:
    """Motion of the key's object. alike: correlation over the object. inside: its share within the picture. error_px:
    expected shift of its outline."""

    motion: Motion
    alike: float = 0.0
    inside: float = 0.0
    error_px: float = float("inf")

    @property
    def is_sure(self) -> bool:
        return self.alike >= ALIKE and self.inside >= INSIDE


@dataclass(frozen=True, kw_only=True, slots=True)
class Key:
    """A picture's object: luma [h, w] and cover [h, w] in pixels of `step` of the frame's, the place of their first
    pixel's corner in the frame [2], and the mask's centre c [2]."""

    luma: np.ndarray
    cover: np.ndarray
    step: float
    first: np.ndarray
    center: np.ndarray


def opencv() -> ModuleType:
    """Return cv2; MissingExtra if it is not installed."""
    return optional("cv2", "opencv-python-headless", "video", "following an object")


def luma(rgb: np.ndarray) -> np.ndarray:
    """(R + 2 G + B) / 4 of bytes [H, W, 3], [H, W] float32."""
    part = rgb.astype(np.float32)
    return (part[..., 0] + 2.0 * part[..., 1] + part[..., 2]) / np.float32(4.0)


def begin_key(picture: np.ndarray, mask: np.ndarray, offset: tuple[int, int] = (0, 0)) -> Key:
    """Return the key of a luma picture [H, W] and the cover [H, W] of its object, which must not be empty.

    offset: x, y of their first pixel in the frame.
    """
    rows, columns = np.nonzero(mask > 0.5)
    longer = int(max(np.ptp(rows), np.ptp(columns))) + 1
    step = max(1.0, longer / FINE_PX)
    return Key(
        luma=_shrunk(picture, step),
        cover=_shrunk(mask.astype(np.float32), step),
        step=step,
        first=np.array(offset, np.float64),
        center=np.array([columns.mean(), rows.mean()]) + 0.5 + offset,
    )


def locate_key(key: Key, picture: np.ndarray, start: Motion, offset: tuple[int, int] = (0, 0)) -> Registered:
    """Return the motion of the key's object in a luma picture [H, W], searched around `start`."""
    cv2 = opencv()
    seen, first = _shrunk(picture, key.step), np.array(offset, np.float64)
    motion = _searched(key, seen, start, first)
    turn = motion.matrix()
    shift = turn @ (key.first - key.center) + key.center + (motion.x, motion.y) - first
    shift = shift / key.step + turn @ np.full(2, 0.5) - 0.5  # from corners of pixels to their centres
    warp = np.column_stack([turn, shift]).astype(np.float32)
    covers = (key.cover > 0.5).astype(np.uint8), np.ones(seen.shape, np.uint8)
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, ROUNDS, DONE)
    best = Registered(motion=motion)
    for kind in (cv2.MOTION_TRANSLATION, cv2.MOTION_EUCLIDEAN, cv2.MOTION_AFFINE):
        try:
            _, moved = cv2.findTransformECCWithMask(key.luma, seen, *covers, warp.copy(), kind, until, 1)
        except cv2.error:  # no convergence, or the object is outside the picture
            continue
        if (found := _motion_of(key, moved.astype(np.float64), first)) is not None:
            result = _judged(key, seen, moved, found)
            if 1.0 - result.alike < FEWER * (1.0 - best.alike):
                best = result
    return best


def _judged(key: Key, seen: np.ndarray, warp: np.ndarray, motion: Motion) -> Registered:
    """Return a motion with its correlation over the object and what it leaves uncertain."""
    cv2 = opencv()
    size = key.luma.shape[::-1]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    there = cv2.warpAffine(np.ones_like(seen), warp, size, flags=flags) > 0.99
    moved = cv2.GaussianBlur(cv2.warpAffine(seen, warp, size, flags=flags), (3, 3), 0)
    blurred = cv2.GaussianBlur(key.luma, (3, 3), 0)
    inside = key.cover > 0.5
    both = inside & there
    if both.sum() < 8:
        return Registered(motion=motion)
    k, m = blurred[both], moved[both]
    k, m = k - k.mean(), m - m.mean()
    gain = float(k @ m) / max(float(k @ k), 1e-6)
    alike = float(k @ m) / np.sqrt(max(float(k @ k) * float(m @ m), 1e-6))
    down, across = np.gradient(blurred)
    slopes = np.stack([across[both], down[both]])
    left = float(np.mean((m - gain * k) ** 2)) / max(gain, 0.1) ** 2
    error = ERROR * float(np.sqrt(np.trace(np.linalg.inv(slopes @ slopes.T + 1e-3 * np.eye(2)) * left))) * key.step
    return Registered(motion=motion, alike=alike, inside=float(both.sum() / inside.sum()), error_px=error)


def _searched(key: Key, seen: np.ndarray, start: Motion, first: np.ndarray) -> Motion:
    """Return `start` shifted to where the object, turned and scaled as before, matches the picture best."""
    cv2 = opencv()
    rows, columns = np.nonzero(key.cover > 0.5)
    longer = max(np.ptp(rows), np.ptp(columns)) + 1
    cell = max(1.0, float(longer) / COARSE_PX)
    size = int(np.ceil(longer / cell)) + 2
    middle = (key.center - key.first) / key.step  # in the key's pixels
    turn = np.linalg.inv(start.matrix()) * cell
    back = np.column_stack([turn, middle - turn @ np.full(2, size / 2.0)])
    flags = cv2.INTER_AREA | cv2.WARP_INVERSE_MAP
    smooth = cv2.GaussianBlur(key.luma, (0, 0), 0.5 * cell)
    look, cover = (cv2.warpAffine(one, back, (size, size), flags=flags) for one in (smooth, key.cover))
    coarse = cv2.resize(seen, None, fx=1.0 / cell, fy=1.0 / cell, interpolation=cv2.INTER_AREA)
    reach = int(np.ceil(SEARCH_REACH * size))
    padded = cv2.copyMakeBorder(coarse, size, size, size, size, cv2.BORDER_REPLICATE)
    at = (key.center + (start.x, start.y) - first) / key.step / cell + size - size / 2.0
    left, top = (int(round(v)) - reach for v in at)
    window = padded[max(top, 0) : top + size + 2 * reach, max(left, 0) : left + size + 2 * reach]
    if min(window.shape) < size:
        return start
    scores = cv2.matchTemplate(window, look, cv2.TM_CCOEFF_NORMED, mask=(cover > 0.5).astype(np.float32))
    y, x = np.mgrid[: scores.shape[0], : scores.shape[1]]
    away = ((x + max(left, 0) - at[0]) ** 2 + (y + max(top, 0) - at[1]) ** 2) / max(reach, 1) ** 2
    scores = np.where(np.isfinite(scores), scores, -1.0) - PULL * away
    row, column = np.unravel_index(int(scores.argmax()), scores.shape)
    moved = (np.array([column + max(left, 0), row + max(top, 0)]) - at) * cell * key.step
    return Motion(x=start.x + float(moved[0]), y=start.y + float(moved[1]), angle=start.angle, scale=start.scale)


def _motion_of(key: Key, warp: np.ndarray, first: np.ndarray) -> Motion | None:
    """Return the similarity nearest to an affine warp [2, 3] from the key's pixels to the picture's; None for one that
    mirrors or flattens the object."""
    turn = warp[:, :2]
    if not (np.isfinite(warp).all() and np.linalg.det(turn) > LEAST_AREA):
        return None
    scale, angle = 0.5 * np.log(np.linalg.det(turn)), np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
    middle = (key.center - key.first) / key.step - 0.5
    x, y = (turn @ middle + warp[:, 2] + 0.5) * key.step + first - key.center
    return Motion(x=float(x), y=float(y), angle=float(angle), scale=float(scale))


def _shrunk(picture: np.ndarray, step: float) -> np.ndarray:
    """Return a picture whose pixels are `step` times as wide, averaged by area; the last may lie partly outside."""
    picture = np.ascontiguousarray(picture, np.float32)
    if step == 1.0:
        return picture
    cv2 = opencv()
    height, width = picture.shape
    rows, columns = int(np.ceil(height / step)), int(np.ceil(width / step))
    below, beside = int(np.ceil(rows * step)) - height, int(np.ceil(columns * step)) - width
    whole = cv2.copyMakeBorder(picture, 0, below, 0, beside, cv2.BORDER_REPLICATE)
    scale = np.array([[step, 0.0, step / 2.0 - 0.5], [0.0, step, step / 2.0 - 0.5]])
    blurred = cv2.GaussianBlur(whole, (0, 0), 0.4 * step)
    return cv2.warpAffine(blurred, scale, (columns, rows), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
