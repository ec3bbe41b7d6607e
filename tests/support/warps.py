"""The densities per steradian of core.sampling's samplers and their inverses, and the paper's sampler of half vectors.

The local frame has n = +Z.
"""

from __future__ import annotations

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.sampling import _stretch, ggx_visible_normal_xyz


def cosine_hemisphere_to_square(d):
    """Inverse of square_to_cosine_hemisphere."""
    xp = array_namespace(d)
    phi = xp.atan2(d[..., 1], d[..., 0]) / (2.0 * np.pi)
    return xp.stack([phi - xp.floor(phi), 1.0 - d[..., 2] ** 2], axis=-1)


def cosine_hemisphere_pdf(d):
    """Density [1/sr] of square_to_cosine_hemisphere."""
    xp = array_namespace(d)
    return xp.clip(d[..., 2], 0.0, None) / np.pi


def square_to_ggx_normal(u, alpha):
    """Microfacet normals h with density D(h) (n.h), as of Eq. 5: [..., 2] -> [..., 3]. Karis 2013.

    cos^2 = (1 - u) / (1 + (alpha^2 - 1) u); (alpha - 1)(alpha + 1) keeps precision.
    """
    cos2 = (1.0 - u[..., 1]) / (1.0 + (alpha - 1.0) * (alpha + 1.0) * u[..., 1])
    sine, phi = np.sqrt(np.clip(1.0 - cos2, 0.0, None)), 2.0 * np.pi * u[..., 0]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(cos2)], axis=-1)


def ggx_normal_to_square(h, alpha):
    """Inverse of square_to_ggx_normal."""
    xp = array_namespace(h)
    phi = xp.atan2(h[..., 1], h[..., 0]) / (2.0 * np.pi)
    cos2 = h[..., 2] ** 2
    v = (1.0 - cos2) / (1.0 + (alpha - 1.0) * (alpha + 1.0) * cos2)
    return xp.stack([phi - xp.floor(phi), v], axis=-1)


def ggx_normal_pdf(h, alpha):
    """Density [1/sr] of square_to_ggx_normal: D(h) cos(theta)."""
    xp = array_namespace(h)
    cosine = xp.clip(h[..., 2], 0.0, None)
    d = cosine**2 * (alpha - 1.0) * (alpha + 1.0) + 1.0
    return alpha**2 * cosine / (np.pi * d * d)


def square_to_ggx_visible_normal(u, wo, alpha):
    """Microfacet normals h that the eye at wo sees, with density G1 D (wo.h) / (n.wo) (Heitz 2018).

    Drawn as in Dupuy and Benyoub 2023: stretched by alpha, the facets are a hemisphere, and what wo
    sees of it mirrors wo into a spherical cap. [..., 2], [..., 3] -> [..., 3]; wo above the horizon.
    """
    xp = array_namespace(u)
    return xp.stack(ggx_visible_normal_xyz(u, wo[..., 0], wo[..., 1], wo[..., 2], alpha), axis=-1)


def ggx_visible_normal_to_square(h, wo, alpha):
    """Inverse of square_to_ggx_visible_normal."""
    xp = array_namespace(h)
    eye = xp.stack(_stretch(wo[..., 0], wo[..., 1], wo[..., 2], alpha), axis=-1)
    facet = xp.stack(_stretch(h[..., 0], h[..., 1], h[..., 2], 1.0 / alpha), axis=-1)
    cap = 2.0 * xp.sum(eye * facet, axis=-1, keepdims=True) * facet - eye
    phi = xp.atan2(cap[..., 1], cap[..., 0]) / (2.0 * np.pi)
    return xp.stack([phi - xp.floor(phi), 1.0 - (cap[..., 2] + eye[..., 2]) / (1.0 + eye[..., 2])], axis=-1)


def ggx_visible_normal_pdf(h, wo, alpha):
    """Density [1/sr] of square_to_ggx_visible_normal: G1(wo) D(h) (wo.h) / (n.wo), with Smith's G1."""
    xp = array_namespace(h)
    d = h[..., 2] ** 2 * (alpha - 1.0) * (alpha + 1.0) + 1.0
    distribution = xp.where(h[..., 2] > 0, alpha**2 / (np.pi * d * d), 0.0 * d)
    facing = xp.clip(xp.sum(h * wo, axis=-1), 0.0, None)
    a2 = alpha**2
    return distribution * facing * 2.0 / (wo[..., 2] + xp.sqrt(a2 + (1.0 - a2) * wo[..., 2] ** 2))
