"""Real spherical harmonics to order 2, without the Condon-Shortley sign; nine numbers a channel.

Order and constants are those of WebXR and three.js, in the camera frame (x, y, z):

    i       0    1    2    3    4    5    6         7    8
    (l,m)   0,0  1,-1 1,0  1,1  2,-2 2,-1 2,0       2,1  2,2
    Y_i/K   1    y    z    x    xy   yz   3z^2 - 1  xz   x^2 - y^2

Coefficients are of radiance, L_i = integral of L Y_i dw; times COSINE_LOBE they are those of irradiance (Ramamoorthi
and Hanrahan 2001). Order 2 may turn negative opposite a strong light: nothing here clamps that. Numbers in the
conventions of Unity, glTF and Filament: export.target_frames.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core import Float
from anyprobe.core.color import luminance

K = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))
"""Normalisation of each polynomial, so that the integral of Y_i Y_j dw is 1 for i = j, else 0."""

COSINE_LOBE = np.array([np.pi, *[2 * np.pi / 3] * 3, *[np.pi / 4] * 5])
"""A_l of max(0, cos): pi, 2 pi / 3, pi / 4."""


def sh_basis(d: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 9"]:
    """Evaluate Y_i at unit directions: [..., 3] -> [..., 9]."""
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    polynomials = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    return np.stack(polynomials, axis=-1) * K.astype(d.dtype)


@lru_cache(maxsize=4)
def pixel_integrals(height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return integrals over every row [6, H] and every column [6, 2H]; their products are those of Y_i / K over pixels.

    With d = (sin t sin p, cos t, -sin t cos p) and dw = sin t dt dp each Y_i is a sum of products of a
    function of t and one of p: here sin t times 1, cos t, sin t, sin t cos t, sin^2 t, cos^2 t, and
    1, sin p, cos p, sin^2 p, cos^2 p, sin p cos p, in closed form. Reading Y_i at the pixel's centre
    instead would give a uniform map a false order 2 of 1e-3.
    """
    t = np.linspace(0, np.pi, height + 1)
    p = np.linspace(-np.pi, np.pi, 2 * height + 1)
    s, c = np.sin(t), np.cos(t)
    rows = [-c, s**2 / 2, t / 2 - np.sin(2 * t) / 4, s**3 / 3, c**3 / 3 - c, -(c**3) / 3]
    sin_2p = np.sin(2 * p) / 4
    columns = [p, -np.cos(p), np.sin(p), p / 2 - sin_2p, p / 2 + sin_2p, np.sin(p) ** 2 / 2]
    return np.diff(rows, axis=1), np.diff(columns, axis=1)


def project(radiance: Float[np.ndarray, "H 2*H 3"]) -> Float[np.ndarray, "9 3"]:
    """Project a map [H, 2H, 3] onto the basis: L_i = sum over pixels of L times the pixel's integral of Y_i, [9, 3].

    Exact for a map that is constant over each pixel: uniform radiance 1 gives L_0 = 2 sqrt(pi) = 3.5449077 alone.
    """
    rows, columns = pixel_integrals(radiance.shape[0])
    # columns first, row by row: a map of thousands of rows is never copied in float64
    seen = np.stack([columns @ row for row in radiance], axis=1)  # [6, H, 3], by functions of p
    one, sine, cosine, sine2, cosine2, mixed = rows @ seen  # [6, 3] each, by functions of t
    linear = [one[0], one[1], -cosine[2], sine[2]]
    quadratic = [sine[3], -cosine[3], 3 * cosine2[4] - one[0], -mixed[4], sine2[4] - one[5]]
    return (np.stack([*linear, *quadratic]) * K[:, None]).astype(np.float32)


def directionality(coefficients: Float[np.ndarray, "9 3"]) -> float:
    """Return |integral of L d dw| / integral of L dw of luminance, 0 (even light) to 1 (one direction)."""
    bright = luminance(coefficients[:4].astype(np.float64)) / K[:4]
    return float(np.linalg.norm(bright[1:]) / bright[0]) if bright[0] > 0 else 0.0
