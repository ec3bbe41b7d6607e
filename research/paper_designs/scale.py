"""The sizes of the experiment, and the eight materials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.scatter.materials import Material

VIEWS = 23
"""Cameras, evenly over the upper hemisphere, as in the paper's Sect. 3.5."""
EPOCHS = 11
"""Epochs of the gradual targets, Sect. 3.3."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Scale:
    """Sizes of one experiment.

    side: of photos. rows: of estimated maps [rows, 2 rows]. light_rows: of the maps that light the objects.
    normals: directions of the visible hemisphere that surfaces can have.
    width: channels of the finest scale of networks with a code, of a U-Net twice as many.
    code: numbers between encoder and decoder.
    batch: pairs a step of a long run.
    """

    side: int
    rows: int
    light_rows: int
    normals: int
    width: int
    code: int
    batch: int


SCALES = {
    "small": Scale(side=24, rows=16, light_rows=64, normals=2048, width=48, code=128, batch=500),
    "full": Scale(side=128, rows=64, light_rows=128, normals=16384, width=64, code=512, batch=500),
}
"""full: the paper's photos of 128 x 128."""


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
"""Even numbers are specular, odd ones diffuse by the paper's border, alpha 0.5. No alpha is twice."""
