"""Fitted (adjective): a map that, seen in an object of known material, looks like the object's photo.

The object's picture is the map seen through Eq. 1 and a camera's curve: y = f(A e^x L), with L the model's guess, x the
logarithm of what it is wrong by in each direction, and A the object's reflectance at each of its points. Where shape
and material are known, so is A, and x can be told from y: the likeliest x under a Gaussian of given variance that is
alike in directions that are near each other (a Gaussian process), found by Gauss and Newton's method.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import MEAN_CURVE
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import shrink
from anyprobe.render.integrate import PATCHES, shade, shading_pyramid
from anyprobe.render.surface import pixel_rays
from anyprobe.scatter.brdf import Material, evaluate

ROWS = 32
"""Rows of the map that the object's points are lit by."""
COARSE = 16
"""Rows of the map that x is told on."""
NUM_POINTS = 200
"""Of the object, at most; they are shaded with so many samples:"""
NUM_SAMPLES = 64
STEPS = 4
WHOLE, FAR, NEAR = 0.3, 0.5, 1.0
"""Variances of x: of its mean, and of its parts that reach as far as the two angles below."""
FAR_DEG, NEAR_DEG = 30.0, 10.0
NOISE_TOLD, NOISE_GUESSED = 0.07, 0.5
"""How far a display value may be off, where normals are known and where they are guessed: a point says little then."""
NARROWEST = 0.15
"""Least alpha of A: a lobe as wide as a pixel of its map. What the object shows of L is shaded with its own."""
INSIDE = 0.99
"""Coverage from which on a pixel is the object's alone."""
STEEP = 0.15
"""Least n.wo of a point that counts: at the rim masks and normals are wrong."""
BURNT = 0.97
"""Display value from which on a point says only how bright it is at least."""
FEWEST = 10
"""Points below which nothing is fitted."""


def fit_map(
    radiance: np.ndarray,
    image: np.ndarray,
    normals: np.ndarray,
    tan_half: float,
    material: Material,
    known: np.ndarray,
) -> np.ndarray:
    """The map that an object of known material asks for, near the one given.

    Args:
        radiance: [64, 128, 3], a model's guess in the crop's frame and the photo's exposure units.
        image: [S, S, 4], the crop: display RGB times mask, and mask.
        normals: [S / k, S / k, 3] in the crop's frame, unit, for a whole number k.
        tan_half: of half the angle that the crop's side takes in.
        material: of the object.
        known: [S / k, S / k] bool, where the normals are known; elsewhere they are guessed.
    Returns:
        [64, 128, 3] float32; as given where the crop shows too little of the object.
    """
    found = _points(image, normals, tan_half, known)
    if found is None:
        return radiance
    n, wo, display, noise = found
    transport = _transport(radiance, n, wo, material)  # [3, N, P] of what each point shows from each pixel
    likeness = _likeness()
    x = np.zeros((3, len(likeness)), np.float32)
    for _ in range(STEPS):
        for channel in range(3):
            parts = transport[channel] * np.exp(_finer(x[channel], ROWS))
            slope, missing = _compare(parts.sum(axis=1), display[:, channel])
            jacobian = _coarser(parts * slope[:, None])
            spread = likeness @ jacobian.T
            asked = np.linalg.solve(jacobian @ spread + np.diag(noise**2), missing + jacobian @ x[channel])
            x[channel] += np.clip(spread @ asked - x[channel], -1.0, 1.0)
    wrong = np.stack([_finer(one, len(radiance)) for one in x], axis=-1)
    return (radiance * np.exp(wrong).reshape(radiance.shape)).astype(np.float32)


def _points(
    image: np.ndarray, normals: np.ndarray, tan_half: float, known: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Points spread over the object: unit n and wo [N, 3], display values [N, 3], how far these may be off [N].

    None of too few.
    """
    size = len(normals)
    small = image.reshape(size, len(image) // size, size, -1, 4).mean(axis=(1, 3))
    wo = pixel_rays(tan_half, size)
    facing = (normals * wo).sum(axis=-1) > STEEP
    inside = np.argwhere((small[..., 3] > INSIDE) & (np.linalg.norm(normals, axis=-1) > 0.5) & facing)
    if len(inside) < FEWEST:
        return None
    at = tuple(inside[np.unique(np.linspace(0, len(inside) - 1, NUM_POINTS).astype(int))].T)
    noise = np.where(known[at], np.float32(NOISE_TOLD), np.float32(NOISE_GUESSED))
    return np.asarray(normals[at], np.float32), np.asarray(wo[at], np.float32), small[at][:, :3], noise


def _transport(radiance: np.ndarray, n: np.ndarray, wo: np.ndarray, material: Material) -> np.ndarray:
    """Eq. 1's summands f_r L (n.wi) dw of each channel, point and pixel, [3, N, P]; their sums are the renderer's."""
    d = pixel_directions(ROWS).reshape(-1, 3).astype(np.float32)
    angles = np.repeat(pixel_solid_angles(ROWS)[:, 0], 2 * ROWS).astype(np.float32)
    wide = replace(material, alpha=max(float(material.alpha), NARROWEST))
    power = shrink(radiance, ROWS).reshape(-1, 3) * angles[:, None]
    reflected = evaluate(wide, wo[:, None], d[None], n[:, None]) * np.maximum(n @ d.T, 0.0)[..., None] * power
    smooth = shading_pyramid(radiance)
    pyramid = smooth if material.alpha >= PATCHES[0][0] else shading_pyramid(radiance, material.alpha)
    shading = shade(pyramid, n, wo, np.float32(material.alpha), hammersley(NUM_SAMPLES), wide=smooth)
    true = shading.radiance(material)
    whole = reflected * ((true + 1e-4) / (reflected.sum(axis=1) + 1e-4))[:, None]
    return np.ascontiguousarray(np.moveaxis(whole, -1, 0))


def _compare(total: np.ndarray, display: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The slope of the mean camera's curve at radiances [N], before it clips, and what display values lack to it."""
    n, sigma = MEAN_CURVE.exponent, MEAN_CURVE.sigma
    power = np.maximum(total, 1e-6) ** n
    shown = (1 + sigma) * power / (power + sigma)
    slope = shown * n * sigma / (power + sigma) / np.maximum(total, 1e-6)
    burnt = (display > BURNT) & (shown > BURNT)
    return np.where(burnt, 0.0, slope), np.where(burnt, 0.0, display - shown)


@lru_cache(maxsize=1)
def _likeness() -> np.ndarray:
    """Covariance of x between directions, [Q, Q]."""
    d = pixel_directions(COARSE).reshape(-1, 3).astype(np.float64)
    degrees = np.degrees(np.arccos(np.clip(d @ d.T, -1.0, 1.0)))
    parts = zip((FAR, NEAR), (FAR_DEG, NEAR_DEG), strict=True)
    covariance = WHOLE + sum(variance * np.exp(-0.5 * (degrees / angle) ** 2) for variance, angle in parts)
    return covariance.astype(np.float32)


def _finer(x: np.ndarray, rows: int) -> np.ndarray:
    """From the Q pixels of the coarse map to those of one of more rows, between its pixels."""
    at = direction_to_uv(pixel_directions(rows).reshape(-1, 3))
    return bilinear(x.reshape(COARSE, 2 * COARSE, 1), at)[:, 0]


def _coarser(values: np.ndarray) -> np.ndarray:
    """Sums over the pixels of the finer map within each of the coarse, [N, P] to [N, Q]."""
    step = ROWS // COARSE
    return (
        values.reshape(len(values), COARSE, step, 2 * COARSE, step).sum(axis=(2, 4)).reshape(len(values), -1)
    )
