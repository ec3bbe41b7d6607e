"""How differently maps shade an object, whatever its exposure."""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import irradiance_map
from anyprobe.match.places import seen_along
from anyprobe.render.spheres import sphere_normals

OWN_ERROR = 0.8
"""Error of an estimate's shading that one in ten exceeds [stops], see shading_apart.

Of 277 left-out renders of whole photos, quantiles of .5, .8 and .9 are .28, .54 and .72, of 105 cut-outs .38, .60 and
.84.
"""
USUAL_ERROR = 0.45
"""Standard deviation of that error [stops]: four in five are below 1.3 times as much."""
SHADED, FAINT = 16, 1e-4
"""Size [px] of the sphere that is compared, and the share of the mean radiance added before logarithms."""
SHADED_ROWS = 32
"""Rows of the maps that shade it."""


def shadings_apart(maps: np.ndarray, map_from_camera: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """Return how differently each of maps [N, 32, 64, 3], rotated [N, 3, 3], and a map [H, 2H, 3] of the camera's frame
    shade a matte sphere, in stops [N]: root mean square over its visible side, exposure being free."""
    n, _ = sphere_normals(SHADED)
    turns = np.concatenate([map_from_camera, np.eye(3)[None]])
    lights = np.concatenate([maps, reduced(camera, SHADED_ROWS)[None]]).astype(np.float32)
    lit = luminance(irradiance_map(lights))[..., None]
    shades = seen_along(lit, np.arange(len(lights)), n @ turns.transpose(0, 2, 1))[..., 0]
    shades = np.log2(np.maximum(shades, 0.0) / np.pi + FAINT * lights.mean(axis=(1, 2, 3))[:, None])
    facing = n[:, 2] / n[:, 2].sum()
    apart = shades[:-1] - shades[-1]
    apart = apart - (apart @ facing)[:, None]
    return np.sqrt(apart**2 @ facing)


def shading_apart(radiance: np.ndarray, other: np.ndarray) -> float:
    """Return the same of two maps [H, 2H, 3] of one frame."""
    return float(shadings_apart(reduced(radiance, SHADED_ROWS)[None], np.eye(3)[None], other)[0])
