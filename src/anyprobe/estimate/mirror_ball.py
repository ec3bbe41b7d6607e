"""Detection of a mirror ball: a circular outline, and the appearance of a mirror.

A mirror shows fine structure all over, so no smooth shading explains its ln radiance; and near its rim it shows the
photo's own background. The first is always required, and either the second or that the network considers it a metal.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import reflect
from anyprobe.core.response import inverse_response
from anyprobe.estimate.normals_hint import sphere_of_outline
from anyprobe.estimate.photo import Photo
from anyprobe.light.harmonics import sh_basis
from anyprobe.masks.check import object_box
from anyprobe.notices import Notice, give

ROUND = 0.95
"""Smallest overlap of a mask with a circle that may be a ball's outline."""
FINE = 0.28
"""Smallest standard deviation of ln radiance around smooth shading of a ball that may be a mirror."""
METAL, AGREE, AGREE_FINELY = 0.7, 0.9, 0.45
"""Smallest probability of a metal, or correlation of the rim with the expected reflection, of a mirror; and the same
correlation of what smooth shading does not explain. Of balls drawn under 15 maps 13 reach one of the correlations, of
twelve photos of a grey ball none; the last number was chosen on these same balls and photos."""
LEAST_PIXELS = 25
"""Smallest number of rim pixels for a correlation."""
MOST_SIDE = 192
"""Largest number of pixels sampled across the ball."""
LEAST_SIDE_PX = 24
"""Smallest side [px] of a ball; a smaller one shows too little."""
FACING, INNER = 0.15, 0.4
"""Smallest n.wo of pixels that count, and of those that smooth shading is fitted to."""
FLOOR = 0.02
"""Radiance added before its logarithm."""
CHROME = "chrome"
"""Material assumed for a detected ball."""


def said_of_ball(name: str) -> Notice:
    """Return the warning that describes what was done."""
    text = (
        "the object is round and shows its surroundings, so it was unwrapped as a mirror ball of chrome, which it may "
        "not be"
    )
    return Notice(text, code="mirror-ball", source=name, remedy=give("material"))


def is_mirror_ball(photo: Photo, metal: float) -> bool:
    """Return whether the object of a photo is a mirror ball; metal: the network's probability of a metal."""
    x0, y0, x1, y1 = object_box(photo.mask)
    side, other = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    if other < max(LEAST_SIDE_PX, 0.8 * side):
        return False
    step = max(1, int(side // MOST_SIDE))
    mask, rgb = photo.mask[::step, ::step], photo.rgb[::step, ::step]
    normals, overlap = sphere_of_outline(mask, photo.long_fov_deg)
    if overlap < ROUND:
        return False
    d, focal = _rays(mask.shape, photo.long_fov_deg)
    facing = -(normals * d).sum(axis=-1)
    on = (mask > 0.99) & (facing > FACING)
    ln = np.log(inverse_response(rgb) + FLOOR)
    if _fineness(normals, ln.mean(axis=-1), on & (facing > INNER)) < FINE:
        return False
    if metal >= METAL:
        return True
    whole, finely = _agreement(normals, reflect(-d, normals), ln, on, mask, focal)
    return whole >= AGREE or finely >= AGREE_FINELY


def _rays(shape: tuple[int, int], long_fov_deg: float) -> tuple[np.ndarray, float]:
    """Return unit directions [H, W, 3] of a photo's pixels, and its focal length in pixels."""
    height, width = shape
    focal = max(shape) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    y, x = np.mgrid[:height, :width] + 0.5
    d = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    return d / np.linalg.norm(d, axis=-1, keepdims=True), float(focal)


def _fineness(normals: np.ndarray, level: np.ndarray, on: np.ndarray) -> float:
    """Return the standard deviation of ln radiance [H, W] around the best sum of harmonics of the normal."""
    n = normals[on]
    return 0.0 if len(n) < 100 else float(np.std(_beside_shading(n, level[on])))


def _beside_shading(n: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return the residual of levels [P] after fitting a sum of harmonics of normals [P, 3]."""
    n = n.astype(np.float64)
    x, y, z = n.T
    terms = np.concatenate([sh_basis(n), np.stack([x**3, y**3, x * y * z], axis=-1)], axis=-1)
    fit, *_ = np.linalg.lstsq(terms, level, rcond=None)
    return level - terms @ fit


def _agreement(
    normals: np.ndarray, wi: np.ndarray, ln: np.ndarray, on: np.ndarray, mask: np.ndarray, focal: float
) -> tuple[float, float]:
    """Correlate the reflection from wi [H, W, 3] with the photo there, directly and without smooth shading; 0 if too
    few pixels."""
    height, width = mask.shape
    front = np.maximum(-wi[..., 2], 0.05)
    column, row = width / 2 + focal * wi[..., 0] / front, height / 2 - focal * wi[..., 1] / front
    inside = on & (wi[..., 2] < -0.3) & (column > 0) & (column < width) & (row > 0) & (row < height)
    at = row[inside].astype(int), column[inside].astype(int)
    free = mask[at] < 0.01
    if free.sum() < LEAST_PIXELS:
        return 0.0, 0.0
    shown, own = ln[at][free].mean(axis=-1), ln[inside][free].mean(axis=-1)
    n = normals[inside][free]
    return _correlation(shown, own, 0.05), _correlation(_beside_shading(n, shown), _beside_shading(n, own), 0.03)


def _correlation(one: np.ndarray, other: np.ndarray, least: float) -> float:
    """Return the correlation of two arrays [P]; 0 where one varies by less than the least standard deviation."""
    return 0.0 if min(one.std(), other.std()) < least else float(np.corrcoef(one, other)[0, 1])
