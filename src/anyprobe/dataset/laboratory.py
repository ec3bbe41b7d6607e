"""Laboratory (noun): one camera that never changes, exact masks and eight known materials.

What the paper says of its photos (Sect. 3.5) names no exposure, white balance or response curve that would differ
between them; its material properties "are randomly selected for each rendering, resulting in 8 random materials". Here
the eight are always the same, which is easier.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import MEAN_CURVE
from anyprobe.dataset.camera import Shot
from anyprobe.scatter.brdf import Material

CAMERA = Shot(
    metering=0.0,
    object_key=0.25,
    scene_key=0.25,
    white_balance=np.ones(3, np.float32),
    curve=MEAN_CURVE,
    object_range=(0.0, np.inf),
)
"""The scene's mean alone decides the exposure, the object has no say; no colour is balanced."""


def _material(albedo: float | tuple, f0: float | tuple, alpha: float) -> Material:
    albedo, f0 = (np.broadcast_to(np.asarray(value, np.float32), 3).copy() for value in (albedo, f0))
    return Material(albedo=albedo, f0=f0, alpha=alpha)


MATERIALS = (
    _material((0.50, 0.06, 0.05), 0.04, 0.05),  # red, glossy
    _material(0.80, 0.04, 0.95),  # white, matte
    _material(0.0, (0.55, 0.56, 0.55), 0.10),  # chromium
    _material(0.0, (0.56, 0.57, 0.58), 0.60),  # iron
    _material(0.20, 0.05, 0.25),  # grey plastic
    _material((0.10, 0.25, 0.35), 0.04, 0.85),  # blue, matte
    _material(0.0, (1.00, 0.77, 0.34), 0.40),  # gold
    _material(0.0, (0.96, 0.64, 0.54), 0.70),  # copper
)
"""By a recipe's number: bit 0 diffuse rather than specular, bit 1 metal, bit 2 another of these. No alpha is twice."""

ALPHAS = tuple(material.alpha for material in MATERIALS)


def material_of(alpha: float) -> Material:
    """The one of that alpha; KeyError if there is none."""
    return _BY_ALPHA[alpha]


_BY_ALPHA = dict(zip(ALPHAS, MATERIALS, strict=True))
