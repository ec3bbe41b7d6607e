"""Reflectance maps by matrix products: radiance of every normal, for a few GGX widths, of many lights at once.

Lo = f0 S1 + (1 - f0) (Ss + albedo Dd), all three linear in the light: a matrix each from the pixels of a map
[ROWS, 2 ROWS] in the camera's frame to a reflectance map [size, size] seen along +Z (render.reflectance).
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.render.reflectance import reflectance_normals
from anyprobe.scatter.microfacet import (
    albedo_table,
    directional_albedo,
    ggx_distribution,
    schlick_weight,
    smith_visibility,
)

SIZE = 48
ROWS = 32
ALPHAS = (0.1, 0.2, 0.35, 0.6, 1.0)
"""Between these the tables are mixed; below the first, with what a mirror shows."""
FINER = 2
"""Points a pixel of the map, along either side: the narrowest lobe is 15 degrees wide, a pixel 6."""


def reflectance_matrices(size: int = SIZE) -> np.ndarray:
    """[2 len(ALPHAS) + 1, size^2, 2 ROWS^2] float32: S1 and Ss of each width, then Dd."""
    n = reflectance_normals(size).reshape(-1, 3)
    wi = pixel_directions(FINER * ROWS).reshape(-1, 3)
    angles = np.repeat(pixel_solid_angles(FINER * ROWS)[:, 0], 2 * FINER * ROWS).astype(np.float32)
    n_dot_wo, n_dot_wi = n[:, 2:], np.maximum(n @ wi.T, 0.0)
    h = wi + np.array([0.0, 0.0, 1.0], np.float32)
    h /= np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-6)
    s = schlick_weight(h[:, 2])[None]
    n_dot_h, table = n @ h.T, albedo_table()
    result = []
    for alpha in ALPHAS:
        lobe = ggx_distribution(n_dot_h, alpha) * smith_visibility(n_dot_wo, n_dot_wi, alpha)
        lobe = lobe * n_dot_wi * angles
        whole = directional_albedo(n_dot_wo[:, 0], np.float32(alpha), table)
        for kernel, albedo in zip((lobe, lobe * s), whole, strict=True):
            result.append(_coarse(kernel * (albedo[:, None] / np.maximum(kernel.sum(1, keepdims=True), 1e-9))))
    result.append(_coarse((1.0 - s) / np.float32(np.pi) * n_dot_wi * angles))
    return np.stack(result)


def _coarse(kernel: np.ndarray) -> np.ndarray:
    """Sums over the points of each pixel, [N, 2 ROWS^2]."""
    parts = kernel.reshape(len(kernel), ROWS, FINER, 2 * ROWS, FINER)
    return parts.sum(axis=(2, 4)).reshape(len(kernel), -1).astype(np.float32)
