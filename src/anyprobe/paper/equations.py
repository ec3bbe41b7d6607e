"""The paper's equations 1 to 8, in their order, for NumPy arrays and torch tensors.

wo and wi point from the surface to the eye and to the light, h halves them, n is the normal; alpha is the GGX width.
Cosines are arrays of any shape; radiance is linear, in the photo's exposure units; the frames are those of core.frames.

Eq. 1, without emission, is the integral over the hemisphere of `reflectance` times radiance times n.wi; Eq. 3 splits it
into `diffuse_weight` and `specular_weight`. The paper leaves D, G and F open and names Karis 2013: these are his GGX
and Schlick, with the height-correlated G.
"""

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.contract import contract
from anyprobe.core.frames import dot, normalize
from anyprobe.core.response import MEAN_CURVE, CameraCurve, inverse_response


def ggx_distribution(n_dot_h, alpha):
    """Evaluate D(h) [1/sr] of Eq. 2, Walter et al. 2007 Eq. 33: alpha^2 / (pi ((n.h)^2 (alpha^2 - 1) + 1)^2)."""
    d = n_dot_h**2 * (alpha - 1.0) * (alpha + 1.0) + 1.0
    return alpha**2 / (np.pi * d * d)


def smith_visibility(n_dot_wo, n_dot_wi, alpha):
    """Evaluate G / (4 (n.wo)(n.wi)) of Eq. 2 with the height-correlated Smith term, Heitz 2014 Eq. 99.

    The quotient, not G, is returned: it stays finite at grazing angles.
    """
    xp = array_namespace(n_dot_wo, n_dot_wi)
    a2 = alpha**2
    toward_eye = n_dot_wi * xp.sqrt(a2 + (1.0 - a2) * n_dot_wo**2)
    toward_light = n_dot_wo * xp.sqrt(a2 + (1.0 - a2) * n_dot_wi**2)
    return 0.5 / xp.clip(toward_eye + toward_light, 1e-7, None)  # both cosines 0: no 0/0


def schlick_weight(wo_dot_h):
    """Evaluate s = (1 - wo.h)^5 of Eq. 2's F = f0 + (1 - f0) s (Schlick 1994)."""
    xp = array_namespace(wo_dot_h)
    m = xp.clip(1.0 - wo_dot_h, 0.0, 1.0)
    return m * m * m * m * m


def reflectance(albedo, f0, alpha, wo, wi, n):
    """Evaluate f_r [1/sr], Eq. 2: kd albedo / pi + D F G / (4 (n.wo)(n.wi)), kd = 1 - F; no cosine inside.

    F is taken at the half vector for both parts, which keeps f_r reciprocal. [..., 3] each -> [..., 3].
    """
    xp = array_namespace(wo, wi, n)
    h = normalize(wo + wi)
    n_dot_wo, n_dot_wi = dot(n, wo), dot(n, wi)
    s = schlick_weight(dot(wo, h))
    fresnel = f0 + (1.0 - f0) * s
    specular = ggx_distribution(dot(n, h), alpha) * smith_visibility(n_dot_wo, n_dot_wi, alpha) * fresnel
    value = (1.0 - fresnel) * albedo / np.pi + specular
    above = (n_dot_wo > 0) & (n_dot_wi > 0)
    return xp.where(above, value, xp.zeros_like(value))


def diffuse_weight(n_dot_wi, wo_dot_h):
    """Evaluate what multiplies radiance in Eq. 3's diffuse integral, albedo and 1 - f0 left out: (1 - s) n.wi / pi."""
    return (1.0 - schlick_weight(wo_dot_h)) * n_dot_wi / np.pi


def specular_weight(distribution, n_dot_wo, n_dot_wi, alpha):
    """Evaluate what multiplies radiance in Eq. 3's specular integral, F left out: D G / (4 n.wo).

    distribution: D at the half vector.
    """
    return distribution * smith_visibility(n_dot_wo, n_dot_wi, alpha) * n_dot_wi


def outgoing_radiance(albedo, f0, specular, grazing, diffuse):
    """Sum Eq. 3's integrals, each of radiance times its weight: Lo = f0 S1 + (1 - f0) Ss + albedo (1 - f0) Dd.

    specular, grazing: S1 of specular_weight, and Ss of it times Schlick's s. diffuse: Dd of diffuse_weight.
    """
    return f0 * specular + (1.0 - f0) * grazing + albedo * (1.0 - f0) * diffuse


def sample_density(distribution, n_dot_h, wo_dot_h):
    """Evaluate the density [1/sr] of Eq. 4's directions wi: D (n.h) / (4 wo.h)."""
    return distribution * n_dot_h / (4.0 * wo_dot_h)


def importance_weighted_irradiance(radiance, weight, total, axis: int = -1):
    """Average radiance over directions, Eq. 5's first factor, in radiance's unit.

    weight: Eq. 4's density over that of the directions given, zero below the horizon; total: its sum along axis.
    """
    xp = array_namespace(radiance, weight)
    return xp.sum(radiance * weight, axis=axis) / total


EPOCHS = 11
"""Training epochs of Eq. 6."""


def filter_exponent(epoch: int) -> float:
    """Compute beta e of Eq. 6 with beta = e^2, for epoch 1 to 11: 1 to 1331 (the caption of Fig. 7
    says 1000). An epoch is an eleventh of a run's steps."""
    return float(epoch**3)


def filter_weight(cosine, exponent: float):
    """Evaluate Eq. 6's weight (w_k . n_i)^(beta e), zero beyond 90 degrees; light.filtering applies it to maps."""
    xp = array_namespace(cosine)
    return xp.clip(cosine, 0.0, None) ** exponent


THRESHOLD: float = contract("graph")["blend_from"]
"""tau of Eq. 8."""

LN_MAX: float = contract("graph")["ln_most"]
"""Largest ln radiance that is kept, a little below that of the largest half float."""


def reconstruct(ldr, ln_radiance, curve: CameraCurve = MEAN_CURVE, threshold: float = THRESHOLD):
    """Merge both maps, Eq. 7: R = (1 - gamma) f^-1(U) + gamma exp(H), natural logarithm, in the photo's exposure.

    ldr: display values, clipped to [0, 1]; ldr, ln_radiance and the result are [..., 3].
    """
    xp = array_namespace(ldr, ln_radiance)
    gamma = blend_weight(ldr, threshold)
    ln_radiance = xp.clip(ln_radiance, None, LN_MAX)  # exp must not overflow where gamma is 0
    return (1.0 - gamma) * inverse_response(ldr, curve) + gamma * xp.exp(ln_radiance)


def blend_weight(ldr, threshold: float = THRESHOLD):
    """Compute gamma = max(0, max_c U - tau) / (1 - tau), Eq. 8: [..., 3] -> [..., 1]."""
    xp = array_namespace(ldr)
    brightest = xp.max(xp.clip(ldr, 0.0, 1.0), axis=-1, keepdims=True)
    return xp.clip(brightest - threshold, 0.0, None) / (1.0 - threshold)
