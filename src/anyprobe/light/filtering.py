"""Blurs that depend on the angle alone (zonal kernels), exact on the map's pixels.

On a latitude-longitude grid such a kernel couples rows i and j through their longitude difference only, so a Fourier
transform along the columns turns it into one small matrix a frequency: 64 x 64 matrices instead of 8192 x 8192.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from array_api_compat import array_namespace, device

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.paper.equations import filter_weight


def _cap(cosine: np.ndarray, radius: float) -> np.ndarray:
    return (np.arccos(cosine) <= radius).astype(np.float64)


@lru_cache(maxsize=48)
@np.errstate(under="ignore")  # which a caller may have made an error
def _spectrum(
    height: int, weight: Callable[[np.ndarray, float], np.ndarray], parameter: float, normalised: bool = True
) -> np.ndarray:
    """Return the cosine spectrum [F, H, H] of weight(cos angle, parameter) dOmega, rows out x rows in."""
    theta = (np.arange(height) + 0.5) * np.pi / height
    delta = np.arange(2 * height) * np.pi / height
    across, along = np.sin(theta), np.cos(theta)
    cosine = np.outer(along, along)[..., None] + np.outer(across, across)[..., None] * np.cos(delta)
    kernel = weight(np.clip(cosine, -1.0, 1.0), parameter) * pixel_solid_angles(height).astype(np.float64)[None]
    if normalised:
        kernel /= kernel.sum(axis=(1, 2), keepdims=True)
    return np.fft.rfft(kernel, axis=2).real.transpose(2, 0, 1).astype(np.float32)


@np.errstate(under="ignore")
def _apply(radiance, spectrum: np.ndarray):
    """Apply a zonal kernel to maps [..., H, 2H, C]."""
    xp = array_namespace(radiance)
    width, channels = radiance.shape[-2:]
    waves = xp.fft.rfft(xp.moveaxis(radiance, -2, -3), axis=-3)  # [..., F, H, C]
    kernel = xp.asarray(spectrum, device=device(radiance))
    both = kernel @ xp.concat([xp.real(waves), xp.imag(waves)], axis=-1)  # a large kernel, read once
    blurred = xp.fft.irfft(both[..., :channels] + 1j * both[..., channels:], n=width, axis=-3)
    return xp.astype(xp.moveaxis(blurred, -3, -2), radiance.dtype)


def blur_cosine_power(radiance, sharpness: float):
    """Average radiance [..., H, 2H, C] around each direction with weight max(0, cos)^sharpness, sharpness > 0.

    Paper Eq. 6 with sharpness = beta e, over all pixels, weighted by solid angle (the paper leaves the measure open). A
    constant map is unchanged; sharpness 1 gives irradiance / pi.
    """
    if sharpness <= 0:
        raise ValueError(f"expected sharpness > 0, got {sharpness}")
    return _apply(radiance, _spectrum(radiance.shape[-3], filter_weight, float(sharpness)))


def blur_cap(radiance, radius: float):
    """Average radiance over the cap of the given radius [radians] around each direction."""
    return _apply(radiance, _spectrum(radiance.shape[-3], _cap, float(radius)))


def irradiance_map(radiance):
    """Compute irradiance E(n) = integral of L max(0, n.wi) dwi, for n at every pixel centre."""
    return _apply(radiance, _spectrum(radiance.shape[-3], filter_weight, 1.0, normalised=False))
