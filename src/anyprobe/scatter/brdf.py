"""The paper's reflectance, Eq. 2: Lambert below a Cook-Torrance coat.

f_r = kd albedo / pi + D F G / (4 (n.wo)(n.wi)), kd = 1 - F, F by Schlick at wo.h.
Taking F at the half vector for both parts keeps f_r reciprocal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.frames import dot, normalize
from anyprobe.scatter.microfacet import ggx_distribution, schlick_weight, smith_visibility


@dataclass(frozen=True, kw_only=True, slots=True)
class Material:
    """A uniform material.

    albedo: diffuse albedo in [0, 1], [3] or one number for all channels; zero for a metal.
    f0: reflectance at normal incidence in [0, 1], [3] or one number; grey and small for a dielectric.
    alpha: GGX width in [0.01, 1].
    """

    albedo: Any
    f0: Any
    alpha: float


def evaluate(material: Material, wo, wi, n):
    """f_r(wo, wi) [1/sr], paper Eq. 2; no cosine inside. [..., 3] each -> [..., 3]."""
    xp = array_namespace(wo, wi, n)
    h = normalize(wo + wi)
    n_dot_wo, n_dot_wi = dot(n, wo), dot(n, wi)
    s = schlick_weight(dot(wo, h))
    fresnel = material.f0 + (1.0 - material.f0) * s
    specular = (
        ggx_distribution(dot(n, h), material.alpha)
        * smith_visibility(n_dot_wo, n_dot_wi, material.alpha)
        * fresnel
    )
    value = (1.0 - fresnel) * material.albedo / np.pi + specular
    above = (n_dot_wo > 0) & (n_dot_wi > 0)
    return xp.where(above, value, xp.zeros_like(value))
