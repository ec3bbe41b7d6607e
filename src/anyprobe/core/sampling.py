"""Samplers: pure functions of the numbers u in [0, 1)^2 handed to them.

The local frame has n = +Z. Densities and inverses are in tests/support/warps.py.
"""

from __future__ import annotations

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core import Float


def hammersley(count: int, shift: tuple[float, float] = (0.0, 0.0)) -> Float[np.ndarray, "count 2"]:
    """Return low-discrepancy points u [count, 2] in [0, 1)^2, moved by shift with wrap-around."""
    reversed_bits = [int(f"{index:032b}"[::-1], base=2) for index in range(count)]
    u = np.stack([(np.arange(count) + 0.5) / count, np.array(reversed_bits) / 2.0**32], axis=-1)
    u = ((u + np.asarray(shift)) % 1.0).astype(np.float32)
    return np.minimum(u, np.float32(1.0 - 2.0**-24))  # float32 rounds 0.99999999 up to 1


def _polar(cos_theta, sin_theta, phi):
    xp = array_namespace(cos_theta)
    return sin_theta * xp.cos(phi), sin_theta * xp.sin(phi), cos_theta


def square_to_cosine_hemisphere(u):
    """Draw directions with density cos(theta) / pi: [..., 2] -> [..., 3]."""
    return array_namespace(u).stack(cosine_hemisphere_xyz(u), axis=-1)


def cosine_hemisphere_xyz(u):
    """Apply square_to_cosine_hemisphere in components x, y, z [...], for compiled kernels."""
    xp = array_namespace(u)
    return _polar(xp.sqrt(1.0 - u[..., 1]), xp.sqrt(u[..., 1]), 2.0 * np.pi * u[..., 0])


def _stretch(x, y, z, alpha):
    """Normalise (alpha x, alpha y, z)."""
    xp = array_namespace(z)
    x, y = alpha * x, alpha * y
    inverse = 1.0 / xp.sqrt(x * x + y * y + z * z)
    return x * inverse, y * inverse, z * inverse


def ggx_visible_normal_xyz(u, wo_x, wo_y, wo_z, alpha):
    """Draw microfacet normals h visible from wo, with density G1 D (wo.h) / (n.wo) (Heitz 2018); wo above the horizon.

    Results are components x, y, z [...], for compiled kernels. Method of Dupuy and Benyoub 2023: stretched by alpha,
    the facets are a hemisphere, and the part of it that faces wo mirrors wo into a spherical cap.
    """
    xp = array_namespace(u)
    eye_x, eye_y, eye_z = _stretch(wo_x, wo_y, wo_z, alpha)
    cap_z = (1.0 - u[..., 1]) * (1.0 + eye_z) - eye_z
    sine = xp.sqrt(xp.clip(1.0 - cap_z * cap_z, 0.0, None))
    x, y, _ = _polar(cap_z, sine, 2.0 * np.pi * u[..., 0])
    return _stretch(x + eye_x, y + eye_y, cap_z + eye_z, alpha)
