"""The paper's Fig. 2: from the photo of an object to the HDR map, around its three networks.

Pictures are [N, C, H, W], of NumPy or torch; the networks are callables that take and return such pictures.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from array_api_compat import array_namespace

from anyprobe.core.response import MEAN_CURVE, CameraCurve
from anyprobe.paper.equations import reconstruct

LN_SCALE = (-7.0, 9.0)
"""Natural logarithms of radiance that the HDR net learns as 0 to 1. The paper does not print its scale."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Chained:
    """Pictures of the chain in its order: display values, display values, ln radiance, radiance of 1 = white."""

    irradiance: Any
    ldr: Any
    ln_radiance: Any
    radiance: Any


def estimate_light(
    photo, irradiance_net: Callable, illumination_net: Callable, hdr_net: Callable, curve: CameraCurve = MEAN_CURVE
) -> Chained:
    """Estimate light from photos of an object.

    Args:
        photo: [N, 4, S, S], display RGB times mask, and mask.
        irradiance_net: photo to I-Irradiance RGB [N, 3, S, S], display values (Sect. 3.2).
        illumination_net: I-Irradiance RGB and mask [N, 4, S, S] to an LDR map [N, 3, R, 2 R], 0 to 1 (Sect. 3.3).
        hdr_net: LDR map to its ln radiance (Sect. 3.4).
        curve: the camera's f in Eq. 7.
    """
    xp = array_namespace(photo)
    irradiance = irradiance_net(photo)
    ldr = illumination_net(xp.concat([irradiance, photo[:, 3:]], axis=1))
    ln_radiance = hdr_net(ldr)
    radiance = reconstruct(xp.moveaxis(ldr, 1, -1), xp.moveaxis(ln_radiance, 1, -1), curve)
    radiance = xp.moveaxis(radiance, -1, 1)
    return Chained(irradiance=irradiance, ldr=ldr, ln_radiance=ln_radiance, radiance=radiance)
