"""GGX microfacets: distribution, shadowing, Fresnel. alpha is the GGX width.

All arguments are cosines of the local frame, arrays of any shape; 1/sr where named.
"""

from __future__ import annotations

import numpy as np
from array_api_compat import array_namespace


def ggx_distribution(n_dot_h, alpha):
    """D(h) [1/sr], Walter et al. 2007 Eq. 33: alpha^2 / (pi ((n.h)^2 (alpha^2 - 1) + 1)^2)."""
    d = n_dot_h**2 * (alpha - 1.0) * (alpha + 1.0) + 1.0
    return alpha**2 / (np.pi * d * d)


def smith_visibility(n_dot_wo, n_dot_wi, alpha):
    """G / (4 (n.wo)(n.wi)) with the height-correlated Smith term, Heitz 2014 Eq. 99.

    The quotient, not G, is returned: it stays finite at grazing angles.
    """
    xp = array_namespace(n_dot_wo, n_dot_wi)
    a2 = alpha**2
    toward_eye = n_dot_wi * xp.sqrt(a2 + (1.0 - a2) * n_dot_wo**2)
    toward_light = n_dot_wo * xp.sqrt(a2 + (1.0 - a2) * n_dot_wi**2)
    return 0.5 / xp.clip(toward_eye + toward_light, 1e-7, None)  # both cosines 0: no 0/0


def schlick_weight(wo_dot_h):
    """s = (1 - wo.h)^5, so that Schlick's F = f0 + (1 - f0) s."""
    xp = array_namespace(wo_dot_h)
    m = xp.clip(1.0 - wo_dot_h, 0.0, 1.0)
    return m * m * m * m * m


def f0_from_ior(ior):
    """Reflectance at normal incidence of a dielectric in air: ((n - 1) / (n + 1))^2."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2
