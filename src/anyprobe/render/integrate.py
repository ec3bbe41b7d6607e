"""Shading by importance sampling: paper Eq. 3-5, all terms from the same samples.

Schlick's Fresnel is linear in f0, so the reflected radiance of any material of one
alpha is a sum of three images that know nothing of colour:

    Lo = f0 S1 + (1 - f0) Ss + albedo (1 - f0) Dd
    S1 = int D V     L (n.wi) dwi        (V = G / (4 (n.wo)(n.wi)))
    Ss = int D V s   L (n.wi) dwi        (s = (1 - wo.h)^5)
    Dd = int (1 - s) L (n.wi) dwi / pi

The functions run on NumPy arrays and on torch tensors, compiled or not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.frames import dot, normalize, world_from_local
from anyprobe.core.sampling import square_to_cosine_hemisphere, square_to_ggx_normal
from anyprobe.light.octahedral import Pyramid, lookup
from anyprobe.scatter.brdf import Material
from anyprobe.scatter.microfacet import ggx_distribution, schlick_weight, smith_visibility

LOD_BIAS = 0.5
"""Levels added to the one whose texel matches a sample's solid angle.

Neighbouring samples then overlap a little. Measured against 16k samples over six maps, 64
samples err by 9-13 % in irradiance with 0.5, by 7-12 % with 0 (but more noise in lone suns)
and by 14-20 % with 1.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shading:
    """What a set of points [..., 3] sends to the eye, and the light it averages.

    irradiance: the first factor of Eq. 5, radiance units.
    specular, grazing: S1 and Ss.   diffuse: Dd.
    """

    irradiance: Any
    specular: Any
    grazing: Any
    diffuse: Any

    def radiance(self, material: Material):
        """Lo of Eq. 3 for a material whose alpha is the one shaded with."""
        return (
            material.f0 * self.specular
            + (1.0 - material.f0) * self.grazing
            + material.albedo * (1.0 - material.f0) * self.diffuse
        )


def _lod(pdf, num_samples: int, pyramid: Pyramid):
    """Level whose texel covers the solid angle 1 / (N pdf) that a sample stands for."""
    xp = array_namespace(pdf)
    texel = 4.0 * np.pi / pyramid.side**2
    return 0.5 * xp.log2(1.0 / (num_samples * xp.clip(pdf, 1e-9, None) * texel)) + LOD_BIAS


def shade_specular(pyramid: Pyramid, n, wo, alpha, u):
    """Importance-weighted irradiance (Eq. 5), S1 and Ss.

    Samples follow the paper: h with density D (n.h), wi = reflect(wo, h), so that
    pdf(wi) = D (n.h) / (4 wo.h). Those below the horizon or seen from behind
    (n.wi <= 0 or wo.h <= 0) weigh zero in Eq. 4 and are left out of Eq. 5's mean.

    Args:
        n, wo: [P, 3].
        alpha: scalar or [P, 1].
        u: [S, 2].
    Returns:
        irradiance, S1, Ss: [P, 3] each.
    """
    xp = array_namespace(n, wo, u)
    h_local = square_to_ggx_normal(u[None], alpha)
    h = world_from_local(h_local, n[:, None])
    wo = wo[:, None]
    wo_dot_h = dot(wo, h)
    wi = 2.0 * wo_dot_h * h - wo
    n_dot_h = xp.clip(h_local[..., 2:3], 1e-6, None)
    n_dot_wo = xp.clip(dot(n[:, None], wo), 1e-4, None)  # seen at 90 degrees: no 0/0
    n_dot_wi = dot(n[:, None], wi)
    kept = xp.astype((n_dot_wi > 0) & (wo_dot_h > 0), n.dtype)
    a = alpha[:, None] if getattr(alpha, "ndim", 0) else float(alpha)
    pdf = ggx_distribution(n_dot_h, a) * n_dot_h / (4.0 * xp.clip(wo_dot_h, 1e-4, None))
    light = lookup(pyramid, wi, _lod(pdf[..., 0], u.shape[0], pyramid)) * kept
    # D V (n.wi) / pdf, the Fresnel term left out
    weight = (
        4.0
        * smith_visibility(n_dot_wo, xp.clip(n_dot_wi, 1e-6, None), a)
        * xp.clip(n_dot_wi, 0.0, None)
        * xp.clip(wo_dot_h, 0.0, None)
        / n_dot_h
    )
    weighted = light * weight
    irradiance = xp.sum(light, axis=1) / xp.clip(xp.sum(kept, axis=1), 1.0, None)
    return irradiance, xp.mean(weighted, axis=1), xp.mean(weighted * schlick_weight(wo_dot_h), axis=1)


def shade_diffuse(pyramid: Pyramid, n, wo, u):
    """Dd [P, 3] by cosine sampling: the mean of (1 - s) L."""
    xp = array_namespace(n, wo, u)
    local = square_to_cosine_hemisphere(u)[None]
    wi = world_from_local(local, n[:, None])
    pdf = local[..., 2:3] / np.pi + xp.zeros_like(wi[..., :1])
    s = schlick_weight(dot(wo[:, None], normalize(wo[:, None] + wi)))
    light = lookup(pyramid, wi, _lod(pdf[..., 0], u.shape[0], pyramid))
    return xp.mean((1.0 - s) * light, axis=1)


def shade(pyramid: Pyramid, n, wo, alpha, u, u_diffuse=None) -> Shading:
    """All terms of Eq. 3-5 at points with normal n, seen from wo. Shapes as above."""
    irradiance, specular, grazing = shade_specular(pyramid, n, wo, alpha, u)
    diffuse = shade_diffuse(pyramid, n, wo, u if u_diffuse is None else u_diffuse)
    return Shading(irradiance=irradiance, specular=specular, grazing=grazing, diffuse=diffuse)
