"""Cutting the object out of a box around it by colour (GrabCut), with OpenCV."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.errors import InvalidMask, MissingExtra
from anyprobe.masks.check import check_mask
from anyprobe.masks.pointing import check_box

GRABCUT_LONG_PX = 640
"""Longer side of the picture that GrabCut works on; its time grows with the area."""

GRABCUT_ROUNDS = 5
EDGE_ROUNDS = 2

EDGE_BAND_PX = 19
"""Width of the band around a coarse mask's edge in which GrabCut decides, at GRABCUT_LONG_PX."""

CLICK_REACH, CLICK_SURE, BORDER = 0.15, 0.02, 0.02
"""Radii around a click that start as perhaps and surely the object, and width of the border that surely is
not, in longer sides."""


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


def cut_around(rgb: np.ndarray, point: tuple[float, float]) -> np.ndarray | None:
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


def cut_edge(rgb: np.ndarray, cover: np.ndarray) -> np.ndarray:
    """A coarse mask with its edge moved by GrabCut; what is sure in it stays.

    Args:
        rgb: [H, W, 3] display values in [0, 1].
        cover: [H, W] in [0, 1]; sure where it is, averaged over 3 % of the longer side, beyond 0.05 and 0.95.
    """
    cv2 = _need_cv2("cutting the object's edge")
    height, width = cover.shape
    small, _ = _shrink(cv2, rgb)
    coarse = cv2.resize(np.ascontiguousarray(cover, np.float32), (small.shape[1], small.shape[0]))
    soft = cv2.blur(coarse, (EDGE_BAND_PX, EDGE_BAND_PX))
    labels = np.where(coarse > 0.5, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[soft < 0.05], labels[soft > 0.95] = cv2.GC_BGD, cv2.GC_FGD
    if not (labels % 2 == 0).any() or not (labels % 2 == 1).any():
        return cover
    cut = _cut(cv2, small, labels, None, EDGE_ROUNDS, cv2.GC_INIT_WITH_MASK)
    return _smooth(cv2, cut, width, height)


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
