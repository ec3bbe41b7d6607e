"""The eight materials of Sect. 3.5, metals and others, specular and diffuse. The paper prints none."""

import numpy as np

from anyprobe.scatter.materials import Material

Color = float | tuple[float, float, float]


def _material(albedo: Color, f0: Color, alpha: float) -> Material:
    diffuse, coat = (np.broadcast_to(np.asarray(color, np.float32), 3).copy() for color in (albedo, f0))
    return Material(albedo=diffuse, f0=coat, alpha=alpha)


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
