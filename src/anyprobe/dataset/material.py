"""Random materials, after the paper's "metal and non-metal from diffuse to specular"."""

from __future__ import annotations

import numpy as np

from anyprobe.scatter.materials import Material
from anyprobe.scatter.microfacet import f0_from_ior

ALPHA_MIN = 0.01
SPECULAR_BELOW = 0.5
"""The paper's border between specular and diffuse materials."""

METALS = (  # linear Rec. 709 reflectance at normal incidence
    (1.00, 0.77, 0.34),  # gold
    (0.96, 0.64, 0.54),  # copper
    (0.97, 0.96, 0.92),  # silver
    (0.91, 0.92, 0.92),  # aluminium
    (0.56, 0.57, 0.58),  # iron
    (0.55, 0.56, 0.55),  # chromium
    (0.89, 0.79, 0.43),  # brass
)


def draw_alpha(rng: np.random.Generator, specular: bool | None = None) -> float:
    """GGX width: log-uniform in [0.01, 0.5) for specular, uniform in [0.5, 1] for diffuse."""
    if specular is None:
        specular = rng.random() < 0.5
    if specular:
        return float(np.exp(rng.uniform(np.log(ALPHA_MIN), np.log(SPECULAR_BELOW))))
    return float(rng.uniform(SPECULAR_BELOW, 1.0))


METAL_SHARE = 0.4


def draw_material(rng: np.random.Generator, alpha: float, metal: bool | None = None) -> Material:
    """A metal with a tabled f0 made a little different, or a dielectric; METAL_SHARE decides if not given.

    Dielectrics have an index of refraction in [1.3, 1.8] and an albedo that is
    white to dark, often grey, sometimes strongly coloured.
    """
    drawn = rng.random() < METAL_SHARE
    if drawn if metal is None else metal:
        f0 = np.array(METALS[rng.integers(len(METALS))]) * rng.uniform(0.75, 1.0) + rng.normal(0, 0.02, 3)
        return Material(
            albedo=np.zeros(3, np.float32), f0=np.clip(f0, 0.2, 1.0).astype(np.float32), alpha=alpha
        )
    f0 = np.full(3, f0_from_ior(rng.uniform(1.3, 1.8)), np.float32)
    value = rng.uniform(0.08, 0.9)
    tint = np.exp(rng.normal(0.0, rng.choice([0.03, 0.15, 0.6]), size=3))
    albedo = np.clip(value * tint / tint.max(), 0.01, 0.95).astype(np.float32)
    return Material(albedo=albedo, f0=f0, alpha=alpha)
