"""Cutting the object out of a box around it by colour (GrabCut), with OpenCV."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.errors import InvalidMask, MissingExtra
from anyprobe.masks.check import check_mask, object_box
from anyprobe.masks.pointing import check_box

GRABCUT_LONG_PX = 640
"""Longer side of the picture that GrabCut works on; its time grows with the area."""

GRABCUT_ROUNDS = 5

CLICK_REACH, CLICK_SURE, BORDER = 0.15, 0.02, 0.02
"""Radii around a click that start as perhaps and surely the object, and width of the border that surely is
not, in longer sides."""

SEED_MARGIN = 0.12
"""Reach around a rough mask's box in which GrabCut may find the object, in the box's longer sides."""


def mask_from_box(rgb: np.ndarray, box: Sequence[float]) -> np.ndarray:
    """Cut the object out of a box around it with GrabCut (Rother et al. 2004).

    Args:
        rgb: [H, W, 3] display values in [0, 1].
        box: X0, Y0, X1, Y1 in pixels, X1 and Y1 exclusive, with some background inside.
    Raises:
        InvalidMask: the box is not inside the picture, or nothing was found in it.
        MissingExtra: OpenCV is not installed.
    """
    height, width = rgb.shape[:2]
    x0, y0, x1, y1 = check_box(box, width, height)
    cv2 = _need_cv2("cutting the object out of a box")
    small, scale = _shrink(cv2, rgb)
    small_height, small_width = small.shape[:2]
    left = min(int(x0 * scale), small_width - 1)
    top = min(int(y0 * scale), small_height - 1)
    right = min(small_width, max(left + 1, round(x1 * scale)))
    bottom = min(small_height, max(top + 1, round(y1 * scale)))
    if (left, top, right, bottom) == (0, 0, small_width, small_height):
        left, right = 1, small_width - 1  # the surroundings must not be empty
    labels = np.zeros((small_height, small_width), dtype=np.uint8)
    window = (left, top, right - left, bottom - top)
    cut = _cut(cv2, small, labels, window, GRABCUT_ROUNDS, cv2.GC_INIT_WITH_RECT)
    if not cut.any():
        raise InvalidMask(
            f"box: expected an object in {x0:g},{y0:g},{x1:g},{y1:g}, found none that stands out; "
            "pass --mask FILE"
        )
    return check_mask(_smooth(cv2, cut, width, height))


def cut_surroundings(rgb: np.ndarray, point: tuple[float, float]) -> np.ndarray | None:
    """What GrabCut makes of one click x, y alone: [H, W], or None where nothing stands out.

    The click's surroundings start as the object, the photo's border as what is not.
    """
    cv2 = _need_cv2("cutting out what was clicked")
    height, width = rgb.shape[:2]
    small, scale = _shrink(cv2, rgb)
    longer = max(small.shape[:2])
    y, x = np.ogrid[: small.shape[0], : small.shape[1]]
    distance = np.hypot(x + 0.5 - point[0] * scale, y + 0.5 - point[1] * scale) / longer
    labels = np.full(small.shape[:2], cv2.GC_PR_BGD, np.uint8)
    labels[distance < CLICK_REACH] = cv2.GC_PR_FGD
    border = max(1, round(BORDER * longer))
    labels[:border] = labels[-border:] = labels[:, :border] = labels[:, -border:] = cv2.GC_BGD
    labels[distance < CLICK_SURE] = cv2.GC_FGD
    cut = _cut(cv2, small, labels, None, GRABCUT_ROUNDS, cv2.GC_INIT_WITH_MASK)
    return _smooth(cv2, cut, width, height) if cut.any() else None


def cut_seeded(
    rgb: np.ndarray, cover: np.ndarray, on: Sequence[tuple[float, float]] = (), off=()
) -> np.ndarray | None:
    """GrabCut that starts from a rough mask and may move far from it; None where nothing is left.

    Args:
        rgb: [H, W, 3] display values in [0, 1].
        cover: [h, w] in [0, 1] of the same extent; the object is somewhere around cover > 0.5.
        on, off: clicks x, y on the object and beside it, which are believed.
    """
    cv2 = _need_cv2("cutting out what was found")
    height, width = rgb.shape[:2]
    small, scale = _shrink(cv2, rgb)
    coarse = cv2.resize(np.ascontiguousarray(cover, np.float32), (small.shape[1], small.shape[0]))
    labels = np.full(coarse.shape, cv2.GC_BGD, np.uint8)
    if (coarse > 0.5).any():
        x0, y0, x1, y1 = object_box(coarse)
        more = max(2, round(SEED_MARGIN * max(x1 - x0, y1 - y0)))
        surroundings = (slice(max(y0 - more, 0), y1 + more), slice(max(x0 - more, 0), x1 + more))
        labels[surroundings] = np.where(coarse[surroundings] > 0.5, cv2.GC_PR_FGD, cv2.GC_PR_BGD)
    y, x = np.ogrid[: labels.shape[0], : labels.shape[1]]
    for points, label in ((on, cv2.GC_FGD), (off, cv2.GC_BGD)):
        for column, row in points:
            distance = np.hypot(x + 0.5 - column * scale, y + 0.5 - row * scale)
            labels[distance < CLICK_SURE * max(labels.shape)] = label
    if len(np.unique(labels % 2)) < 2:
        return None
    cut = _cut(cv2, small, labels, None, GRABCUT_ROUNDS, cv2.GC_INIT_WITH_MASK)
    return _smooth(cv2, cut, width, height) if cut.any() else None


def _need_cv2(purpose: str):
    try:
        import cv2
    except ImportError as error:
        raise MissingExtra("opencv-python-headless", "box", purpose) from error
    return cv2


def _shrink(cv2, rgb: np.ndarray) -> tuple[np.ndarray, float]:
    """The photo as OpenCV wants it, [h, w, 3] uint8 BGR, at most GRABCUT_LONG_PX long, and its scale."""
    height, width = rgb.shape[:2]
    scale = min(1.0, GRABCUT_LONG_PX / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(np.round(small[..., ::-1] * 255.0).astype(np.uint8)), scale


def _cut(cv2, picture: np.ndarray, labels: np.ndarray, window, rounds: int, mode: int) -> np.ndarray:
    """GrabCut's foreground, [h, w] float32 of 0 and 1."""
    cv2.setRNGSeed(0)  # its clustering starts at random
    models = np.zeros((1, 65)), np.zeros((1, 65))
    try:
        cv2.grabCut(picture, labels, window, *models, rounds, mode)
    except cv2.error as error:
        raise InvalidMask(f"box: cutting out failed ({error.err}); pass --mask FILE") from error
    return np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.float32)


def _smooth(cv2, cut: np.ndarray, width: int, height: int) -> np.ndarray:
    smooth = cv2.GaussianBlur(cut, (0, 0), 1.0)
    large = cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.clip((large - 0.25) / 0.5, 0.0, 1.0)
