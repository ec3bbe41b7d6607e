"""Detection of a mirror ball: a circular outline, and the appearance of a mirror.

A mirror shows fine structure all over, so no smooth shading explains its ln radiance; and near its rim it shows the
photo's own background. The first is always required, and either the second, or that the network considers it a metal,
or that the ball is black but for bright spots: such a ball reflects, be it chrome or black glass.
Plastic also shows its surroundings near the rim, but hardly elsewhere; paint shows structure that differs from them.
Rim and background are compared by colour and place, in cells of some degrees: one pixel of the rim mirrors many.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.core.frames import reflect
from anyprobe.core.latlong import direction_to_uv, pixel_directions
from anyprobe.core.response import inverse_response
from anyprobe.estimate.normals_hint import normals_from_outline, rays_through, sphere_of_outline
from anyprobe.estimate.photo import Photo, inputs_of
from anyprobe.light.harmonics import sh_basis
from anyprobe.masks.check import object_box
from anyprobe.masks.parts import grow
from anyprobe.notices import Notice, give

_NUMBERS = contract("mirror_ball")

ROUND: float = _NUMBERS["round"]
"""Smallest overlap of a mask with a circle that may be a ball's outline."""
FINE: float = _NUMBERS["fine"]
"""Smallest standard deviation of ln radiance around smooth shading of a mirror whose rim agrees."""
METAL, FINE_METAL = _NUMBERS["metal"], _NUMBERS["fine_metal"]
"""Smallest probability of a metal, and the same deviation, of a mirror whose rim need not agree."""
AGREE, AGREE_FINELY = _NUMBERS["agree"], _NUMBERS["agree_finely"]
"""Smallest correlations of the rim with the expected reflection, directly and without smooth changes, of a mirror.

All numbers but those of black balls were chosen on balls of mirrors, metals, plastics and paints, drawn under training
maps through lenses of 42 to 72 degrees taken for 65, as JPEG with noise.
"""
BLACK, BLACK_SHARE = _NUMBERS["black"], _NUMBERS["black_share"]
BRIGHT, BRIGHT_SHARE = _NUMBERS["bright"], _NUMBERS["bright_share"]
"""Radiance that a share of the ball does not exceed, and that another share does, of a black ball with bright spots.

Chosen on these balls, of which only mirrors have it, and on photos of chrome in a dark room.
"""
LENSES: list[float] = _NUMBERS["lenses"]
"""Factors of an assumed field of view at which the rim may agree; a known one is taken as it is."""
CELL_ROWS, LEAST_CELLS = _NUMBERS["cell_rows"], _NUMBERS["least_cells"]
"""Rows of the map of cells, 3 degrees each, and smallest number of them for a correlation."""
MARGIN_PX: int = _NUMBERS["margin_px"]
"""Width [px] of the strip outside the outline that does not count as background."""
MOST_SIDE: int = _NUMBERS["most_side"]
"""Largest number of pixels sampled across the ball."""
LEAST_SIDE_PX: int = _NUMBERS["least_side_px"]
"""Smallest side [px] of a ball; a smaller one shows too little."""
FACING, INNER = _NUMBERS["facing"], _NUMBERS["inner"]
"""Smallest n.wo of pixels that count, and of those that smooth shading is fitted to."""
FLOOR: float = _NUMBERS["floor"]
"""Radiance added before the logarithm, of a ball."""
RIM_FLOOR, RIM_FLOOR_SHARE = _NUMBERS["rim_floor"], _NUMBERS["rim_floor_share"]
"""The same of its rim and the background: the larger of a constant, and of a share of the background's median."""
LONG_PX, LEAST_SIDE = _NUMBERS["long_px"], _NUMBERS["least_side"]
"""Size of a photo up to which all pixels count, and smallest number sampled across the ball of a larger one."""
CHROME: str = _NUMBERS["material"]
"""Material assumed for a detected ball."""


def said_of_ball(name: str) -> Notice:
    """Return the warning that describes what was done."""
    text = (
        "the object is round and shows its surroundings, so it was unwrapped as a mirror ball of chrome, which it may "
        "not be"
    )
    return Notice(text, code="mirror-ball", source=name, remedy=give("material"))


@dataclass(frozen=True, kw_only=True, slots=True)
class Ball:
    """An object that looks like a mirror ball.

    Attributes:
        photo: of it, with a sphere's normals.
        inputs: what the networks are given of it.
        least_metal: the network's probability of a metal from which on it is one.
    """

    photo: Photo
    inputs: dict[str, np.ndarray]
    least_metal: float


def find_ball(photo: Photo) -> Ball | None:
    """Return a photo's object as a ball; None where it does not look like one, or its shape or material is given."""
    if photo.material is not None or photo.normals is not None or (least := least_metal(photo)) > 1.0:
        return None
    ball = replace(photo, normals=normals_from_outline(photo.mask, photo.long_fov_deg))
    return Ball(photo=ball, inputs=inputs_of(ball), least_metal=least)


def least_metal(photo: Photo) -> float:
    """Return the probability of a metal from which on the object is a mirror ball; infinity: it never is."""
    x0, y0, x1, y1 = object_box(photo.mask)
    side, other = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    if other < max(LEAST_SIDE_PX, 0.8 * side):
        return np.inf
    step = max(1, side // MOST_SIDE, min(max(photo.mask.shape) // LONG_PX, side // LEAST_SIDE))
    mask, rgb = photo.mask[::step, ::step], photo.rgb[::step, ::step]
    normals, overlap = sphere_of_outline(mask, photo.long_fov_deg)
    if overlap < ROUND:
        return np.inf
    d, facing, on = _seen(normals, mask, photo.long_fov_deg)
    radiance = inverse_response(rgb)
    fine = _fineness(normals, np.log(radiance + FLOOR).mean(axis=-1), on & (facing > INNER))
    if fine < FINE:
        return np.inf
    if _is_black_with_spots(radiance[on & (facing > INNER)].max(axis=-1)):
        return 0.0
    unless_agreed = METAL if fine >= FINE_METAL else np.inf
    beside = _beside(mask) if photo.hidden is None else _beside(mask) & ~photo.hidden[::step, ::step]
    if not beside.any():
        return unless_agreed
    for factor in LENSES if photo.fov_source == "default" else (1.0,):
        fov_deg = factor * photo.long_fov_deg
        if factor != 1.0:
            normals, _ = sphere_of_outline(mask, fov_deg)
        d, _, on = _seen(normals, mask, fov_deg)
        whole, finely = _agreement(reflect(-d[on], normals[on]), radiance[on], d[beside], radiance[beside])
        if whole >= AGREE and finely >= AGREE_FINELY:
            return 0.0
    return unless_agreed


def _is_black_with_spots(brightest: np.ndarray) -> bool:
    """Return whether a ball of pixels with these largest channels [P] is black but for bright spots."""
    return bool(np.quantile(brightest, BLACK_SHARE) <= BLACK and (brightest >= BRIGHT).mean() >= BRIGHT_SHARE)


def _seen(normals: np.ndarray, mask: np.ndarray, long_fov_deg: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rays [H, W, 3], n.wo [H, W], and which pixels show the ball."""
    height, width = mask.shape
    camera = PinholeCamera.of_fov(width, height, long_fov_deg)
    d, _ = rays_through((slice(0, height), slice(0, width)), camera)
    facing = -(normals * d).sum(axis=-1)
    return d, facing, (mask > 0.99) & (facing > FACING)


def _beside(mask: np.ndarray) -> np.ndarray:
    """Return which pixels of a mask [H, W] are MARGIN_PX away from the object."""
    near = mask >= 0.01
    for _ in range(MARGIN_PX):
        near = grow(near)
    return ~near


def _fineness(normals: np.ndarray, level: np.ndarray, on: np.ndarray) -> float:
    """Return the standard deviation of ln radiance [H, W] around the best sum of harmonics of the normal."""
    if on.sum() < 100:
        return 0.0
    n = normals[on].astype(np.float64)
    x, y, z = n.T
    terms = np.concatenate([sh_basis(n), np.stack([x**3, y**3, x * y * z], axis=-1)], axis=-1)
    return float(np.std(_beside_fit(terms, level[on])))


def _beside_fit(terms: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the residual of values [P] or [P, C] after a fit of terms [P, T]."""
    fit, *_ = np.linalg.lstsq(terms, values, rcond=None)
    return values - terms @ fit


def _agreement(wi: np.ndarray, own: np.ndarray, d: np.ndarray, shown: np.ndarray) -> tuple[float, float]:
    """Correlate the radiance own [P, 3] that a ball mirrors from wi [P, 3] with that shown [Q, 3] at d [Q, 3].

    ln radiance of all channels is compared in the cells that have both, directly and without what changes smoothly
    with the direction; 0 if there are too few cells.
    """
    (own_count, own_mean), (count, mean) = _in_cells(wi, own), _in_cells(d, shown)
    both = (own_count > 0) & (count >= 0.5 * np.median(count[count > 0]))
    if both.sum() < LEAST_CELLS:
        return 0.0, 0.0
    floor = max(RIM_FLOOR, RIM_FLOOR_SHARE * float(np.median(mean[both])))
    one, other = np.log(own_mean[both] + floor), np.log(mean[both] + floor)
    x, y, _ = pixel_directions(CELL_ROWS).reshape(-1, 3)[both].T.astype(np.float64)
    level = np.ones_like(x)[:, None]
    smooth = np.stack([level[:, 0], x, y, x**2, y**2, x * y], axis=-1)
    whole, finely = (_correlation(_beside_fit(terms, one), _beside_fit(terms, other)) for terms in (level, smooth))
    return whole, finely


def _in_cells(directions: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the number [N] and the mean [N, 3] of values [P, 3] in each cell of the sphere."""
    u, v = direction_to_uv(directions).T
    columns = 2 * CELL_ROWS
    row, column = (np.clip((x * n).astype(int), 0, n - 1) for x, n in ((v, CELL_ROWS), (u, columns)))
    cell, cells = row * columns + column, CELL_ROWS * columns
    count = np.bincount(cell, minlength=cells)
    sums = np.stack([np.bincount(cell, channel, minlength=cells) for channel in values.T], axis=-1)
    return count, sums / np.maximum(count, 1)[:, None]


def _correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Return the correlation of residuals [P, C] about 0."""
    return float((one * other).sum() / np.sqrt((one**2).sum() * (other**2).sum() + 1e-12))
