"""A material's reflectance, and the irradiance of nine harmonics, as the tests' integrals need them."""

from __future__ import annotations

import numpy as np

from anyprobe.light.harmonics import COSINE_LOBE, sh_basis
from anyprobe.paper.equations import reflectance
from anyprobe.scatter.materials import Material


def brdf(material: Material, wo, wi, n):
    """f_r(wo, wi) [1/sr], paper Eq. 2; no cosine inside. [..., 3] each -> [..., 3]."""
    return reflectance(material.albedo, material.f0, material.alpha, wo, wi, n)


def irradiance(coefficients: np.ndarray, n: np.ndarray) -> np.ndarray:
    """E(n) = sum of A_l L_i Y_i(n): [9, 3] and [..., 3] -> [..., 3]; Lambert sends albedo E / pi."""
    return sh_basis(n) @ (coefficients * COSINE_LOBE.astype(coefficients.dtype)[:, None])
