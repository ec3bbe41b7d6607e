"""A coarse mask brought to the photo's own edges: the guided filter of He, Sun and Tang (ECCV 2010)."""

from __future__ import annotations

import numpy as np
from PIL import Image

LONG_PX = 640
"""Longer side of the picture that the filter is computed on; its answer is applied at full size."""

RADIUS = 1 / 80
"""Of the filter's window, in longer sides: two pixels of a mask 160 across."""

EPSILON = 1e-4
"""Variance of display values below which a window counts as flat."""

STEEPNESS = 2.0
"""How much the filter's soft answer is steepened around one half."""


def resize(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """Float32 [H, W] or [H, W, C] to another size: averaged over areas when shrinking, else linear."""
    if picture.ndim == 3:
        return np.stack([resize(picture[..., c], width, height) for c in range(picture.shape[2])], axis=-1)
    image = Image.fromarray(np.ascontiguousarray(picture, np.float32))
    return np.asarray(image.resize((width, height), Image.Resampling.BILINEAR))


def refine(rgb: np.ndarray, cover: np.ndarray, radius: float = RADIUS, epsilon: float = EPSILON) -> np.ndarray:
    """A mask [H, W] in [0, 1] like cover, with its edge where the photo has one.

    In every window the mask becomes the linear function of colour that fits cover best, so
    that it keeps inside and outside and takes the photo's edge between them.

    Args:
        rgb: [H, W, 3] display values in [0, 1].
        cover: [h, w] in [0, 1], of any size and the same extent: a network's answer.
        radius: of the window in longer sides of the photo; epsilon: see EPSILON.
    """
    height, width = rgb.shape[:2]
    scale = min(1.0, LONG_PX / max(height, width))
    small = max(1, round(width * scale)), max(1, round(height * scale))
    guide = resize(rgb, *small)
    target = resize(cover, *small)
    reach = max(1, round(radius * max(small)))
    slope, offset = _fit(guide, target, reach, epsilon)
    fitted = resize(offset, width, height).copy() if scale < 1.0 else offset
    for channel in range(3):  # one at a time: a large photo's slopes take as much as itself
        plane = slope[..., channel]
        fitted += (resize(plane, width, height) if scale < 1.0 else plane) * rgb[..., channel]
    fitted -= 0.5
    fitted *= STEEPNESS
    fitted += 0.5
    return np.clip(fitted, 0.0, 1.0, out=fitted)


def guided(guide: np.ndarray, target: np.ndarray, reach: int, epsilon: float) -> np.ndarray:
    """The guided filter itself: target [h, w] smoothed, but not across the edges of guide [h, w, 3]."""
    slope, offset = _fit(guide, target, reach, epsilon)
    return (slope * guide).sum(axis=-1) + offset


def _fit(guide: np.ndarray, target: np.ndarray, reach: int, epsilon: float) -> tuple[np.ndarray, np.ndarray]:
    """Slope [h, w, 3] and offset [h, w] of the fits of all windows over each pixel, averaged."""
    mean = box_mean(np.dstack([guide, target]), reach)
    mean_guide, mean_target = mean[..., :3], mean[..., 3]
    pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    products = [guide[..., i] * guide[..., j] for i, j in pairs]
    products += [guide[..., i] * target for i in range(3)]
    moments = box_mean(np.stack(products, axis=-1), reach)
    spread = {
        (i, j): moments[..., k] - mean_guide[..., i] * mean_guide[..., j] + (epsilon if i == j else 0.0)
        for k, (i, j) in enumerate(pairs)
    }
    along = moments[..., 6:] - mean_guide * mean_target[..., None]
    slope = _solve(spread, along)
    offset = mean_target - (slope * mean_guide).sum(axis=-1)
    smooth = box_mean(np.dstack([slope, offset]), reach)
    return smooth[..., :3], smooth[..., 3]


def _solve(spread: dict[tuple[int, int], np.ndarray], right: np.ndarray) -> np.ndarray:
    """x of the symmetric 3 x 3 systems spread x = right [..., 3], by cofactors."""
    a, b, c = spread[0, 0], spread[0, 1], spread[0, 2]
    d, e, f = spread[1, 1], spread[1, 2], spread[2, 2]
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * aa + b * ab + c * ac
    x, y, z = right[..., 0], right[..., 1], right[..., 2]
    solved = np.stack([aa * x + ab * y + ac * z, ab * x + bb * y + bc * z, ac * x + bc * y + cc * z], axis=-1)
    return solved / determinant[..., None]


def box_mean(picture: np.ndarray, reach: int) -> np.ndarray:
    """Mean [H, W, C] over the square of 2 reach + 1 pixels around each, of what of it is in the picture."""
    total = picture.astype(np.float64)
    for axis in (0, 1):
        length = picture.shape[axis]
        summed = np.concatenate([np.zeros_like(total.take([0], axis)), total.cumsum(axis)], axis)
        at = np.arange(length)
        low, high = np.maximum(at - reach, 0), np.minimum(at + reach + 1, length)
        count = (high - low).reshape([-1 if i == axis else 1 for i in range(total.ndim)])
        total = (summed.take(high, axis) - summed.take(low, axis)) / count
    return total
