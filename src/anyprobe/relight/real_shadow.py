"""Depth of shadows on the ground, measured by the real object's own shadow.

A proxy of the real object, as wide and high as it, casts its shadow under the estimate; where the photo shows the
ground, ln of its brightness is compared with ln of that shadow: ln L = k ln s + a plane of the picture. The slope k is
1 where the photo's shadow is as deep as the estimate's, less where the sky fills it more, or where it lies elsewhere.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.response import inverse_response
from anyprobe.estimate.ground import contact_of
from anyprobe.estimate.photo import Photo
from anyprobe.masks.check import object_box
from anyprobe.relight.ground_view import View
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere

LEAST_DEPTH, MOST_DEPTH = 0.65, 1.1
"""Bounds of the slope: an unseen shadow may be occluded by the object, or lie on a dark surface."""
LEAST_SPREAD, LEAST_PIXELS = 0.08, 150
"""Smallest standard deviation of ln s, and smallest number of ground pixels, for an estimate."""
SAMPLED_SIDE = 160
"""Length [px] of the photo's longer side when sampled."""
ROUNDS = 4
"""Number of rounds of the reweighted fit."""
FLOOR = 0.01
"""Value added before logarithms."""


def shadow_depth(photo: Photo, view: View, radiance: np.ndarray) -> float:
    """Return the exponent of an inserted object's shadow, 1 to leave it as under the estimate [H, 2H, 3]."""
    x0, y0, x1, y1 = object_box(photo.mask)
    x, row = contact_of(photo.mask)
    foot = view.on_ground(x, row)
    if not np.isfinite(foot).all():
        return 1.0
    depth = -foot[2]
    wide, high = ((x1 - x0) * depth / view.focal / 2, (y1 - y0) * depth / view.focal / 2)
    stand_in = _ellipsoid(foot, view.up, wide, high)
    shadow = GroundShadow(stand_in, foot, max(wide, high), view.up, radiance, 96, 96)
    step = max(1, max(view.width, view.height) // SAMPLED_SIDE)
    row_px, column_px = np.mgrid[0 : view.height : step, 0 : view.width : step] + 0.5
    ground = view.on_ground(column_px.ravel(), row_px.ravel())
    mask = photo.mask[::step, ::step].ravel()
    with np.errstate(invalid="ignore"):
        near = np.linalg.norm(ground - foot, axis=-1) < 0.8 * shadow.reach
    used = np.isfinite(ground).all(axis=-1) & (mask < 0.02) & near
    if used.sum() < LEAST_PIXELS:
        return 1.0
    known = np.log(luminance(shadow.at(ground[used])) + FLOOR)
    shown = np.log(luminance(inverse_response(photo.rgb[::step, ::step].reshape(-1, 3)[used])) + FLOOR)
    if known.std() < LEAST_SPREAD:
        return 1.0
    u, v = column_px.ravel()[used] / view.width, row_px.ravel()[used] / view.height
    terms = np.stack([known, np.ones_like(u), u, v, v * v], axis=-1)
    weight = np.ones(len(u))
    fit = np.zeros(5)
    for _ in range(ROUNDS):
        root = np.sqrt(weight)[:, None]
        fit = np.linalg.lstsq(terms * root, shown * root[:, 0], rcond=None)[0]
        rest = np.abs(shown - terms @ fit)
        weight = 1.0 / np.maximum(rest, max(float(np.median(rest)), 1e-3))
    return float(np.clip(fit[0], LEAST_DEPTH, MOST_DEPTH))


def _ellipsoid(foot: np.ndarray, up: np.ndarray, wide: float, high: float) -> Mesh:
    """Return an upright ellipsoid on the ground with these half axes."""
    ball = sphere(16)
    side = np.cross(up, [0.0, 0.0, 1.0])
    side = side / max(float(np.linalg.norm(side)), 1e-6)
    ahead = np.cross(side, up)
    axes = np.stack([wide * side, high * up, wide * ahead])
    return Mesh(positions=ball.positions @ axes + foot + high * up, faces=ball.faces, normals=ball.normals)
