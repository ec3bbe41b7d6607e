"""From the LDR map and the log map to HDR radiance: paper Eq. 7 and 8."""

from __future__ import annotations

from array_api_compat import array_namespace

from anyprobe.core.contract import contract
from anyprobe.core.response import MEAN_CURVE, CameraCurve, inverse_response

THRESHOLD: float = contract("graph")["blend_from"]
"""tau of Eq. 8."""

LN_MAX: float = contract("graph")["ln_most"]
"""Largest ln radiance that is kept, a little below that of the largest half float."""


def blend_weight(ldr, threshold: float = THRESHOLD, axis: int = -1):
    """Compute gamma = max(0, max_c U - tau) / (1 - tau), paper Eq. 8: [..., 3] -> [..., 1]; channels are along axis."""
    xp = array_namespace(ldr)
    brightest = xp.max(xp.clip(ldr, 0.0, 1.0), axis=axis, keepdims=True)
    return xp.clip(brightest - threshold, 0.0, None) / (1.0 - threshold)


def reconstruct(ldr, ln_radiance, curve: CameraCurve = MEAN_CURVE, threshold: float = THRESHOLD):
    """Merge both maps: R = (1 - gamma) f^-1(U) + gamma exp(H), paper Eq. 7, natural logarithm, in the photo's exposure.

    ldr: display values, clipped to [0, 1]; ldr, ln_radiance and the result are [..., 3].
    """
    xp = array_namespace(ldr, ln_radiance)
    gamma = blend_weight(ldr, threshold)
    ln_radiance = xp.clip(ln_radiance, None, LN_MAX)  # exp must not overflow where gamma is 0
    return (1.0 - gamma) * inverse_response(ldr, curve) + gamma * xp.exp(ln_radiance)
