"""What every normal shows under every map, as matrices over the map's pixels.

The eye is far away along +Z, light is distant and nothing casts shadows (the paper's Sect. 3.1): radiance depends on
the normal alone, and is linear in the map.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.paper.equations import ggx_distribution, schlick_weight, smith_visibility
from anyprobe.scatter.materials import Material

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
TO_EYE = np.array([0.0, 0.0, 1.0], np.float32)


def viewpoint(index: int, count: int) -> tuple[float, float]:
    """Yaw and elevation [radians] of one of count cameras evenly over the upper hemisphere."""
    return float(index * GOLDEN_ANGLE), float(np.arcsin((index + 0.5) / count))


def transport(normals: np.ndarray, material: Material, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Paper Eq. 3 and 5 as matrices over a map of so many rows.

    Args:
        normals: [N, 3], z > 0, camera frame.
    Returns:
        radiance [3, N, Q]: of each colour channel, Q = rows * 2 rows.
        irradiance [N, Q]: importance-weighted; its rows sum to 1.
    """
    wi = pixel_directions(rows).reshape(-1, 3)
    area = np.broadcast_to(pixel_solid_angles(rows), (rows, 2 * rows)).reshape(-1)
    wo_dot_h = np.sqrt(np.clip(0.5 + 0.5 * (wi @ TO_EYE), 1e-8, None))  # |wo + wi| = 2 wo.h
    n_dot_wo = normals[:, 2:]
    n_dot_wi = normals @ wi.T
    above = np.maximum(n_dot_wi, 0.0)
    n_dot_h = np.clip((n_dot_wi + n_dot_wo) / (2.0 * wo_dot_h), 1e-6, 1.0)
    density = ggx_distribution(n_dot_h, np.float32(material.alpha)) * (n_dot_wi > 0)
    # Eq. 4's samples have density D (n.h) / (4 wo.h); those below the horizon weigh nothing
    irradiance = density * n_dot_h / (4.0 * wo_dot_h) * area
    irradiance /= irradiance.sum(axis=1, keepdims=True)
    coat = density * smith_visibility(n_dot_wo, above, np.float32(material.alpha)) * above * area
    s = schlick_weight(wo_dot_h)
    base = above * area * (1.0 - s) / np.float32(np.pi)
    f0, albedo = np.asarray(material.f0), np.asarray(material.albedo)
    radiance = np.stack([coat * (f0[c] + (1.0 - f0[c]) * s) + albedo[c] * (1.0 - f0[c]) * base for c in range(3)])
    return radiance.astype(np.float32), irradiance.astype(np.float32)
