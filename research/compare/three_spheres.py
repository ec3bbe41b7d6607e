"""The field's three spheres, by its published script's own arithmetic, and a clean linear version.

The published comparison (StyleLight, DiffusionLight) compresses the map before it renders, so
that its "HDR" figures are of a gamma curve, divides by pixels and not by numbers, and
takes percentiles over the empty background too. All that is kept in `field_scores`. What
differs: our renderer without noise takes the place of Cycles at 5 samples, spheres
are seen straight on, and the mask is the sphere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.core.frames import reflect
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.light.environment import reduced
from anyprobe.paper.equations import schlick_weight
from anyprobe.render.spheres import SILVER_ALPHA, SILVER_F0, sphere_normals
from anyprobe_train.evaluate.metrics import color_angle_deg, rmse, si_rmse
from research.compare.transport import light, sphere_matrix

FIELD_ROWS = 128
FIELD_SIZE = 32
"""Side of the matt and the silver sphere's picture in pixels: their lobes are wider than its pixels."""
MIRROR_SIZE = 282
"""Side of the mirror sphere's picture, which shows every sun: as published (SPHERE_SHARE of 960 x 540)."""
FIELD_BASE = 0.8
FIELD_DIFFUSE = {"albedo": FIELD_BASE, "f0": 0.04, "alpha": 0.364**2}
"""Principled BSDF: metallic 0, specular 0.5, roughness 0.364, which is sqrt(alpha)."""
FIELD_SILVER = {"f0": FIELD_BASE, "alpha": 0.3271**2}
"""Metallic 1; like the mirror's, its Fresnel term rises from the base to 1 (Schlick)."""
SPHERE_SHARE = 0.12
"""Share of the published picture (960 x 540, 85 mm, 16.1 radii away) that the sphere fills."""
SPHERES = ("diffuse", "silver", "mirror")


def field_tone(radiance: np.ndarray) -> np.ndarray:
    """a I^(1/2.4) with a = 0.5 / median of the positive values; nothing is clipped."""
    compressed = np.maximum(radiance, 0.0) ** (1 / 2.4)
    positive = compressed[compressed > 0]
    return compressed * (0.5 / np.median(positive)) if positive.size else compressed


def _resize(radiance: np.ndarray, rows: int) -> np.ndarray:
    """[H, 2H, 3] to rows: averaged down or interpolated up."""
    if radiance.shape[0] > rows:
        return reduced(radiance, rows)
    u, v = np.meshgrid((np.arange(2 * rows) + 0.5) / (2 * rows), (np.arange(rows) + 0.5) / rows)
    return bilinear(radiance, np.stack([u, v], axis=-1).astype(np.float32))


def _mirror(maps: Sequence[np.ndarray], f0: float) -> list[np.ndarray]:
    """Mirror spheres [P, 3] of MIRROR_SIZE: the map times Schlick's Fresnel term."""
    normals, _ = sphere_normals(MIRROR_SIZE)
    uv = direction_to_uv(reflect(np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape), normals))
    fresnel = f0 + (1.0 - f0) * schlick_weight(normals[:, 2:])
    return [fresnel * bilinear(one, uv) for one in maps]


def field_spheres(maps: Sequence[np.ndarray]) -> list[dict[str, np.ndarray]]:
    """The three spheres [P, 3] of every map [H, 2H, 3], tone-mapped before rendering."""
    toned = [field_tone(_resize(one, FIELD_ROWS)) for one in maps]
    pictures = {
        "diffuse": light(sphere_matrix(FIELD_ROWS, FIELD_SIZE, **FIELD_DIFFUSE), toned),
        "silver": light(sphere_matrix(FIELD_ROWS, FIELD_SIZE, **FIELD_SILVER), toned),
        "mirror": _mirror(toned, FIELD_BASE),
    }
    return [{name: pictures[name][k] for name in SPHERES} for k in range(len(maps))]


def pixel_rmse(p: np.ndarray, g: np.ndarray) -> float:
    """sqrt( sum over pixels and channels of (p - g)^2 / pixels ): sqrt(3) larger than a mean over numbers."""
    return float(np.sqrt(np.square(p.astype(np.float64) - g).sum() / len(p)))


def pixel_si_rmse(p: np.ndarray, g: np.ndarray) -> float:
    """The same after the best single gain on p: (4 a c - b^2) / 4 a with a = pp, b = -2 pg, c = gg."""
    p, g = p.astype(np.float64), g.astype(np.float64)
    a, b, c = (p * p).sum(), -2 * (p * g).sum(), (g * g).sum()
    left = (4 * a * c - b * b) / (4 * a) if a > 0 else c
    return float(np.sqrt(max(left, 0.0) / len(p)))


def normalised_rmse(p: np.ndarray, g: np.ndarray) -> float:
    """pixel_rmse after each picture's percentiles 0.01 and 99.9, background included, went to 0 and 1."""
    return pixel_rmse(_spread(p), _spread(g))


def pixel_angle_deg(p: np.ndarray, g: np.ndarray) -> float:
    """Mean angle between RGB vectors [degrees]; 0 where either is black, as the script's NaN becomes."""
    both = (p > 0).any(axis=-1) & (g > 0).any(axis=-1)
    return color_angle_deg(p, g, both) * float(both.mean()) if both.any() else 0.0


def _spread(sphere: np.ndarray) -> np.ndarray:
    empty = np.zeros(round(sphere.size * (1 / SPHERE_SHARE - 1)))
    low, high = np.percentile(np.concatenate([sphere.reshape(-1), empty]), [0.01, 99.9])
    return (sphere - low) / max(high - low, 1e-12)


def field_scores(truth: np.ndarray, estimates: Sequence[np.ndarray]) -> list[dict[str, float]]:
    """For each estimate "field_<sphere>_<rmse, si_rmse, angle_deg, n_rmse>"; maps [H, 2H, 3]."""
    true, *guessed = field_spheres([truth, *estimates])
    result = []
    for spheres in guessed:
        row = {}
        for name in SPHERES:
            p, g = spheres[name], true[name]
            row[f"field_{name}_rmse"] = pixel_rmse(p, g)
            row[f"field_{name}_si_rmse"] = pixel_si_rmse(p, g)
            row[f"field_{name}_angle_deg"] = pixel_angle_deg(p, g)
            row[f"field_{name}_n_rmse"] = normalised_rmse(p, g)
        result.append(row)
    return result


def clean_scores(truth: np.ndarray, estimates: Sequence[np.ndarray], size: int = FIELD_SIZE) -> list[dict[str, float]]:
    """Linear spheres of radiance, Lambert white, GGX silver and mirror; a mean over all numbers.

    "clean_<sphere>_rmse", "_si_rmse" in units of the true sphere's mean, "_angle_deg".
    """
    height = truth.shape[0]
    maps = [truth, *estimates]
    pictures = {
        "diffuse": light(sphere_matrix(height, size, albedo=1.0), maps),
        "silver": light(sphere_matrix(height, size, f0=SILVER_F0, alpha=SILVER_ALPHA), maps),
        "mirror": _mirror(maps, 1.0),
    }
    result: list[dict[str, float]] = []
    for k in range(1, len(maps)):
        row = {}
        for name in SPHERES:
            p, g = pictures[name][k], pictures[name][0]
            unit, everywhere = max(float(g.mean()), 1e-8), np.ones(len(g), bool)
            row[f"clean_{name}_rmse"] = rmse(p, g) / unit
            row[f"clean_{name}_si_rmse"] = si_rmse(p, g, everywhere) / unit
            row[f"clean_{name}_angle_deg"] = color_angle_deg(p, g, everywhere)
        result.append(row)
    return result
