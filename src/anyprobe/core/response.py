"""The camera: scene radiance to display value, and back.

Eilertsen et al. 2017 (hdrcnn), the homogeneous sigmoid of the paper's Sect. 3.4:
f(x) = (1 + sigma) x^n / (x^n + sigma), so that f(0) = 0 and f(1) = 1.
"""

from dataclasses import dataclass
from typing import Any

# array_namespace would import it at the first call: a process forked while a thread imports hangs
import array_api_compat.numpy  # noqa: F401
from array_api_compat import array_namespace

from anyprobe.core.contract import contract


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraCurve:
    """Both parameters of the curve, numbers or arrays with one entry a photo; defaults are the fitted family's
    means."""

    exponent: Any = contract("curve")["exponent"]
    sigma: Any = contract("curve")["sigma"]


MEAN_CURVE = CameraCurve()
CLIPPED: float = contract("curve")["clipped"]
"""Display value from which on a pixel is only a lower bound of its radiance."""


def response(radiance, curve: CameraCurve = MEAN_CURVE):
    """Convert radiance in the photo's exposure units, >= 0, to display values in [0, 1]; 1 and more clips."""
    xp = array_namespace(radiance)
    x = xp.clip(radiance, 0.0, 1.0) ** curve.exponent
    return (1.0 + curve.sigma) * x / (x + curve.sigma)


def inverse_response(display, curve: CameraCurve = MEAN_CURVE):
    """Convert display values to radiance in [0, 1]: x = (sigma y / (1 + sigma - y))^(1/n)."""
    xp = array_namespace(display)
    y = xp.clip(display, 0.0, 1.0)
    return (curve.sigma * y / (1.0 + curve.sigma - y)) ** (1.0 / curve.exponent)
