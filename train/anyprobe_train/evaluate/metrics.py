"""Metrics of how far a picture or map p is from the true one g.

Pure NumPy; every function computes in float64 and returns a Python number. Pictures are [H, W] or [H, W, C].
"""

import math
from collections.abc import Sequence

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.light.environment import integral
from anyprobe.light.light_sources import LIKELY, LightSource

SSIM_SIGMA = 1.5
SSIM_RADIUS = 5
"""Radius of the window [pixels]: 11 x 11 as in Wang et al. 2004."""

WITHIN_DEG, THERE = 15.0, 0.25
"""A source is false where the truth has less than that share of its power within that angle."""

STOPS = np.arange(-5.0, 5.01, 0.5)
"""Gains that gain_rmse tries before it refines the best [stops]."""


def rmse(a: np.ndarray, b: np.ndarray) -> float:
    """Compute the root of the mean of (a - b)^2 over all numbers."""
    return float(np.sqrt(np.square(np.asarray(a, np.float64) - np.asarray(b, np.float64)).mean()))


def psnr(a: np.ndarray, b: np.ndarray, peak: float = 1.0) -> float:
    """Compute 20 log10( peak / rmse(a, b) ) [dB]; infinite for equal pictures."""
    error = rmse(a, b)
    return 20.0 * math.log10(peak / error) if error > 0 else math.inf


def _window_mean(image: np.ndarray) -> np.ndarray:
    """Compute the Gaussian mean of every whole 11 x 11 window: [H, W, C] -> [H - 10, W - 10, C]."""
    x = np.arange(-SSIM_RADIUS, SSIM_RADIUS + 1)
    kernel = np.exp(-(x**2) / (2 * SSIM_SIGMA**2))
    kernel /= kernel.sum()
    rows, columns = image.shape[0] - 2 * SSIM_RADIUS, image.shape[1] - 2 * SSIM_RADIUS
    down = sum(k * image[i : i + rows] for i, k in enumerate(kernel))
    return sum(k * down[:, i : i + columns] for i, k in enumerate(kernel))


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Compute the structural similarity of values up to 1, Wang et al. 2004 Eq. 13, mean over windows and channels.

        (2 m_a m_b + C1) (2 c_ab + C2) / ((m_a^2 + m_b^2 + C1) (v_a + v_b + C2))
        C1 = 0.01^2, C2 = 0.03^2

    with means m, variances v and covariance c under an 11 x 11 Gaussian of sigma 1.5, the weights summing to 1 (no
    sample correction). Only windows that lie in the picture count.
    """
    a, b = (np.asarray(image, np.float64) for image in (a, b))
    if a.ndim == 2:
        a, b = a[..., None], b[..., None]
    mean_a, mean_b = _window_mean(a), _window_mean(b)
    variance_a = _window_mean(a * a) - mean_a**2
    variance_b = _window_mean(b * b) - mean_b**2
    covariance = _window_mean(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    similarity = ((2 * mean_a * mean_b + c1) * (2 * covariance + c2)) / (
        (mean_a**2 + mean_b**2 + c1) * (variance_a + variance_b + c2)
    )
    return float(similarity.mean())


def si_rmse(p: np.ndarray, g: np.ndarray, mask: np.ndarray) -> float:
    """Compute the RMSE of linear radiance p, g [..., 3] after the best single exposure: s = sum p g / sum p p, then

        sqrt( mean over pixels and channels of the mask [...] of (s p - g)^2 )

    A black p has s = 0. (Some published code divides by pixels only: sqrt(3) larger.)
    """
    p, g = np.asarray(p, np.float64)[mask], np.asarray(g, np.float64)[mask]
    power = (p * p).sum()
    scale = (p * g).sum() / power if power > 0 else 0.0
    return rmse(scale * p, g)


def gain_rmse(p: np.ndarray, g: np.ndarray) -> float:
    """Compute the RMSE of display values of radiance p, g [..., 3] after the best gain within 5.4 stops."""
    target = response(g)

    def error(stops: float) -> float:
        return rmse(response(p * 2.0**stops), target)

    best = min(STOPS, key=error)
    return min(error(best + step) for step in np.linspace(-0.45, 0.45, 13))


def color_angle_deg(p: np.ndarray, g: np.ndarray, mask: np.ndarray) -> float:
    """Compute the mean over the mask [...] of arccos( p.g / (|p| |g|) ) [degrees] of RGB vectors p, g [..., 3].

    A pixel that is black in one picture alone counts 90, in both 0.
    """
    p, g = np.asarray(p, np.float64)[mask], np.asarray(g, np.float64)[mask]
    length_p, length_g = np.linalg.norm(p, axis=-1), np.linalg.norm(g, axis=-1)
    both = (length_p > 0) & (length_g > 0)
    lengths = np.where(both, length_p * length_g, 1.0)
    angle = np.degrees(np.arccos(np.clip((p * g).sum(axis=-1) / lengths, -1.0, 1.0)))
    angle = np.where(both, angle, np.where((length_p > 0) | (length_g > 0), 90.0, 0.0))
    return float(angle.mean())


def direction_error_deg(a: np.ndarray, b: np.ndarray) -> float:
    """Compute the angle between two directions [3]: atan2(|a x b|, a.b) [degrees], exact at 0 and 180."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def power_ratio_stops(p: np.ndarray, g: np.ndarray) -> float:
    """Compute log2( integral of luminance(p) dw / integral of luminance(g) dw ); +1 is twice too bright.

    Maps [H, 2H, 3], each weighted by its own solid angles, so their sizes may
    differ. A black p gives -inf, a black g +inf, two black maps 0.
    """
    power_p, power_g = (float(luminance(integral(np.asarray(m, np.float64)))) for m in (p, g))
    if power_p == power_g:
        return 0.0
    if power_p <= 0 or power_g <= 0:
        return -math.inf if power_p <= 0 else math.inf
    return math.log2(power_p / power_g)


def false_sources(sources: Sequence[LightSource], radiance: np.ndarray, truth: np.ndarray) -> int:
    """Count the likely sources of a map of which the truth [H, 2H, 3] sends less than THERE within WITHIN_DEG of them.

    Powers are shares of their map's, so that an error of the level makes no source false.
    """
    bright = luminance(np.asarray(truth, np.float64)) * pixel_solid_angles(len(truth))
    d, total = pixel_directions(len(truth)), max(float(bright.sum()), 1e-12)
    likely, whole = [one for one in sources if one.exists >= LIKELY], max(float(luminance(integral(radiance))), 1e-12)
    shares = [bright[d @ one.direction > np.cos(np.radians(WITHIN_DEG))].sum() / total for one in likely]
    return sum(there < THERE * luminance(one.power) / whole for there, one in zip(shares, likely, strict=True))
