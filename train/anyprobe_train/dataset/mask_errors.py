"""Errors of masks cut out of photos: too wide, too narrow, ragged, shifted, pierced, cut off."""

import numpy as np

from anyprobe.masks.check import object_box
from anyprobe_train.dataset.camera import blur

MIN_CHANGED_PX = 24
"""Smallest longer side of the remaining object, as estimates require it [pixels]."""

KEPT_SHARE = 0.4
"""Smallest share of the object's pixels that stay in the mask."""

EXACT_SHARE = 0.25
"""Share of masks without errors."""


def widen(mask: np.ndarray, pixels: int) -> np.ndarray:
    """Grow a mask by pixels, alternating cross and square, which makes a point an octagon."""
    for step in range(pixels):
        padded = np.pad(mask, 1)
        rows = padded[:-2] | padded[1:-1] | padded[2:]
        across = rows if step % 2 else padded[1:-1]
        mask = rows[:, 1:-1] | across[:, :-2] | across[:, 2:]
    return mask


def narrow(mask: np.ndarray, pixels: int) -> np.ndarray:
    """Shrink a mask by pixels from every edge but the picture's."""
    return ~widen(~mask, pixels)


def shift(mask: np.ndarray, right: int, down: int) -> np.ndarray:
    """Shift a mask by whole pixels; pixels that leave the picture are lost."""
    reach = max(abs(right), abs(down))
    top, left = reach - down, reach - right
    return np.pad(mask, reach)[top : top + mask.shape[0], left : left + mask.shape[1]]


def fray(mask: np.ndarray, sigma: float, depth: float, rng: np.random.Generator) -> np.ndarray:
    """Make a mask's edge ragged: blur it by sigma pixels, add noise as coarse, cut at one half.

    depth: of the noise, below 0.5; no noise is deeper, so that pixels further from the
    edge than the blur reaches stay what they are.
    """
    picture = np.stack([mask.astype(np.float32), rng.standard_normal(mask.shape, np.float32)])
    soft, noise = blur(picture, sigma)
    noise = np.clip(noise / noise.std() * 0.5, -1.0, 1.0)
    return soft + depth * noise > 0.5


def pierce(mask: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Cut elliptic holes with centres in the mask, each 6 to 24 % of the object across."""
    rows, columns = np.nonzero(mask)
    across = object_px(mask)
    y, x = np.ogrid[: mask.shape[0], : mask.shape[1]]
    for centre in rng.integers(max(len(rows), 1), size=count) if len(rows) else ():
        right, down = x - columns[centre], y - rows[centre]
        angle = rng.uniform(0.0, np.pi)
        a, b = rng.uniform(0.03, 0.12, size=2) * across
        along = (right * np.cos(angle) + down * np.sin(angle)) / a
        aside = (down * np.cos(angle) - right * np.sin(angle)) / b
        mask = mask & (along**2 + aside**2 > 1.0)
    return mask


def cut_off(mask: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Cut off a limb: a share of the object, beyond a line in a random direction."""
    angle = rng.uniform(0.0, 2 * np.pi)
    y, x = np.ogrid[: mask.shape[0], : mask.shape[1]]
    along = x * np.cos(angle) + y * np.sin(angle)
    inside = along[mask]
    return mask & (along <= np.quantile(inside, 1.0 - share)) if len(inside) else mask


def object_px(mask: np.ndarray) -> int:
    """Return the longer side of the mask's bounding box in pixels; 0 if it is empty."""
    left, top, right, bottom = object_box(mask) if mask.any() else (0, 0, 0, 0)
    return max(right - left, bottom - top)


def disturb_mask(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw errors in a mask [S, S] bool as people and programs make them: none in some, one or a few in most.

    An error that would leave too little of the object is left out.
    """
    if rng.random() < EXACT_SHARE:
        return mask
    pixels = int(rng.integers(1, 4))
    right, down = (int(v) for v in rng.integers(-2, 3, size=2))
    errors = (
        (0.35, lambda m: widen(m, pixels)),
        (0.3, lambda m: narrow(m, pixels)),
        (0.3, lambda m: fray(m, rng.uniform(1.0, 2.5), rng.uniform(0.15, 0.45), rng)),
        (0.15, lambda m: pierce(m, int(rng.integers(1, 4)), rng)),
        (0.1, lambda m: cut_off(m, rng.uniform(0.03, 0.2), rng)),
        (0.25, lambda m: shift(m, right, down)),
    )
    result = mask
    for chance, error in errors:
        if rng.random() < chance:
            changed = error(result)
            if object_px(changed) >= MIN_CHANGED_PX and (changed & mask).sum() >= KEPT_SHARE * mask.sum():
                result = changed
    return result


def gross_error(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a mask [H, W] with a strip of the support, a part of a neighbour, without a limb, or beside the object."""
    if not mask.any():
        return mask
    left, top, right, bottom = object_box(mask)
    high, wide = bottom - top, right - left
    right, bottom = right - 1, bottom - 1
    y, x = np.mgrid[0 : mask.shape[0], 0 : mask.shape[1]]
    kind = rng.integers(4)
    if kind == 0:  # the rim of a turntable, the edge of a table
        cx, cy = (left + right) / 2, bottom - rng.uniform(0.0, 0.1) * high
        a, b = wide * rng.uniform(0.4, 0.8), max(2.0, high * rng.uniform(0.06, 0.2))
        return mask | (((x - cx) / a) ** 2 + ((y - cy) / b) ** 2 < 1)
    if kind == 1:
        angle, reach = rng.uniform(0, 2 * np.pi), 0.5 * max(high, wide)
        cx, cy = (left + right) / 2 + reach * np.cos(angle), (top + bottom) / 2 + reach * np.sin(angle)
        a, b = (rng.uniform(0.1, 0.3) * side for side in (wide, high))
        return mask | (((x - cx) / a) ** 2 + ((y - cy) / b) ** 2 < 1)
    if kind == 2:
        angle = rng.uniform(0, 2 * np.pi)
        along = x * np.cos(angle) + y * np.sin(angle)
        return mask & (along < np.quantile(along[mask], 1 - rng.uniform(0.08, 0.3)))
    far = rng.uniform(0.02, 0.08) * max(high, wide)
    angle = rng.uniform(0, 2 * np.pi)
    return shift(mask, round(far * np.cos(angle)), round(far * np.sin(angle)))
