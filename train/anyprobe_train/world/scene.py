"""A scene to trace a photo from, in four arrays that compiled kernels take: a tuple of many costs them more than rays.

World: +Y up, the object stands on y = 0 over the origin, its bounding sphere's radius is 1.
"""

from typing import NamedTuple

import numpy as np

GRID_POINTS = 40
"""Points of light along each side of a panel, see `kernels.panel_point`."""

PANELS, BODIES, SOURCE_COUNT, PANEL, BODY, SOURCE, LIGHT, PICTURE, PICTURE_SIDE, TEXELS, SKY_ROWS = range(11)
"""Indices of `places`: three counts; where in `numbers` panels, bodies, sources, grids of light and pictures of albedo
begin; the pictures' side; texels of a sky; its rows."""
EYE, FALLING, HEAD = 0, 3, 6
"""Where the eye is in `numbers`, the irradiance of level ground (for a map's own), and the first panel."""

ORIGIN, RIGHT, UP, NORMAL, HALF, MIRRORED_SIDE, F0, COAT_ALPHA, MIDDLE, GRID_SPREAD, MEAN, GROUND, PANEL_SIZE = (
    0, 3, 6, 9, 12, 14, 15, 16, 17, 19, 20, 23, 24,
)  # fmt: skip
"""Offsets in a panel, a rectangle whose back is as its front: middle, unit axes, half sides, side after which its
picture is mirrored, coat, middle and spread of its grids, mean albedo, whether that is what the map shows."""
BALL, CELLS_FROM_WORLD, GLOW, BODY_SIZE = 0, 4, 16, 19
"""Offsets in a body, which hides light, the object first: centre of the sphere around its cells and its squared radius;
the affine map [3, 4] from the world to its cells; mean radiance."""
IS_BALL, AT, RADIUS, POWER, SOURCE_SIZE = 0, 1, 4, 5, 8
"""Offsets in a source, which is traced by itself: whether it is a glowing ball; direction to it, or its centre; tangent
of its radius, or that in radii of the object; irradiance on what faces it, or the ball's radiance."""
FREE, LIT, SOFT = 0, 1, 2
"""Grids of a panel, irradiance on its front: without the object; with it; the part of that which no source sends."""


class TracedScene(NamedTuple):
    """numbers: [K] float32. places: [11] int64. words: [B, 64, 64] of render.voxels. sky: [2 TEXELS, 3], flat levels of
    the map, each half the rows of the one before; then the same without sources."""

    numbers: np.ndarray
    places: np.ndarray
    words: np.ndarray
    sky: np.ndarray
