"""Surfaces under and behind photographed objects: wood, cloth, stone and plain paint, as pictures of albedo.

Albedos follow measured light reflectance values (SLL/CIBSE Lighting Guide 11, 2001; DIAL evo): dark wood .08-.2, light
wood .3-.6, stone and concrete .15-.6, cloth .05-.75, paint and laminate .1-.8.
"""

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe_train.dataset.textured import rough_noise, smooth_noise

PIXELS = 512
"""Side of a table's picture."""
KINDS = ("wood", "cloth", "stone", "plain")
ALBEDO = {"wood": (0.08, 0.6), "cloth": (0.05, 0.75), "stone": (0.15, 0.6), "plain": (0.1, 0.8)}
"""Bounds of the mean albedo; even in its logarithm between."""
COATED = {"wood": 0.6, "cloth": 0.0, "stone": 0.4, "plain": 0.5}
"""How many have a sheen (varnish, polish), of GGX width .08 to .4; the rest is rough."""
DYED = {"cloth": 0.7, "plain": 0.35}
"""How many are of a strong colour."""
MOST = 0.9
"""Albedo of no channel is above it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cover:
    """The surface of a table or a wall: albedo [N, N, 3] linear, its GGX width, and side [radii of the object] after
    which it is repeated, mirrored."""

    kind: str
    albedo: np.ndarray
    alpha: float
    side: float


def draw_cover(rng: np.random.Generator, kind: str | None = None) -> Cover:
    """One of KINDS, or the one given."""
    kind = kind or KINDS[rng.integers(len(KINDS))]
    pattern, contrast, side = _pattern(rng, kind)
    value = float(np.exp(rng.uniform(*np.log(ALBEDO[kind]))))
    warm = abs(rng.normal(0.0, 0.25)) if kind == "wood" else rng.normal(0.05, 0.08)
    tint = np.exp(
        np.array([warm, 0.0, -1.3 * warm]) + rng.normal(0.0, 0.3 if rng.random() < DYED.get(kind, 0.0) else 0.02, 3)
    )
    factor = np.exp(contrast * pattern)
    other = np.exp(rng.normal(0.0, 0.06, 3))  # lighter places are of another hue
    albedo = (factor / factor.mean())[..., None] * tint * other ** pattern[..., None].clip(-2, 2)
    albedo = np.clip(value * albedo / luminance(albedo).mean(), 0.01, MOST)
    coated = rng.random() < COATED[kind]
    alpha = float(np.exp(rng.uniform(*np.log((0.08, 0.4) if coated else (0.5, 1.0)))))
    return Cover(kind=kind, albedo=albedo.astype(np.float32), alpha=alpha, side=side)


def _pattern(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, float, float]:
    """Return a texture of deviation near 1, [N, N]; the deviation of ln albedo; the side it covers [radii]."""
    if kind == "wood":
        grain = rough_noise(rng, PIXELS, rng.uniform(0.8, 1.2), rng.uniform(10, 40))
        rings = np.sin(2 * np.pi * (rng.uniform(4, 12) * smooth_noise(rng, PIXELS, 1.5)))
        planks = _planks(rng) if rng.random() < 0.5 else 0.0
        return 0.8 * grain + 0.3 * rings + planks, float(rng.uniform(0.1, 0.3)), float(rng.uniform(5, 14))
    if kind == "cloth":
        weave = rough_noise(rng, PIXELS, 0.3)
        if rng.random() < 0.35:
            y, x = np.mgrid[0:PIXELS, 0:PIXELS] / PIXELS
            count = rng.integers(3, 20)
            weave = weave + 1.5 * np.sign(np.sin(2 * np.pi * count * x))
            if rng.random() < 0.5:
                weave = weave + 1.5 * np.sign(np.sin(2 * np.pi * count * y))
        return weave, float(rng.uniform(0.05, 0.2)), float(rng.uniform(3, 8))
    if kind == "stone":
        veins = -np.abs(smooth_noise(rng, PIXELS, rng.uniform(3, 8))) if rng.random() < 0.5 else 0.0
        return rough_noise(rng, PIXELS, rng.uniform(0.6, 1.4)) + veins, float(rng.uniform(0.08, 0.3)), 8.0
    return rough_noise(rng, PIXELS, 1.2), float(rng.uniform(0.0, 0.04)), 12.0


def _planks(rng: np.random.Generator) -> np.ndarray:
    """Boards along the grain, each of a tone, with dark joints."""
    count = int(rng.integers(3, 8))
    y = np.arange(PIXELS) / PIXELS * count
    joint = (y % 1 < 0.02) | (y % 1 > 0.98)
    tone = rng.standard_normal(count)[y.astype(int)]
    return np.broadcast_to((tone - 4.0 * joint)[:, None], (PIXELS, PIXELS))
