"""Materials by name, for pictures of what a light does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anyprobe.errors import InputError
from anyprobe.scatter.brdf import Material

MATERIALS: dict[str, Material] = {
    "chrome": Material(albedo=np.zeros(3), f0=np.array([0.65, 0.66, 0.66]), alpha=0.03),
    "gold": Material(albedo=np.zeros(3), f0=np.array([1.00, 0.77, 0.34]), alpha=0.12),
    "plastic": Material(albedo=np.array([0.52, 0.06, 0.05]), f0=np.full(3, 0.045), alpha=0.12),
    "matte": Material(albedo=np.full(3, 0.6), f0=np.full(3, 0.04), alpha=0.9),
}


def material_named(name: str, *also: str) -> Material:
    """One of MATERIALS; InputError lists them, and what else the caller would have taken."""
    if name not in MATERIALS:
        raise InputError(f"material: expected one of {', '.join([*MATERIALS, *also])}, got {name!r}")
    return MATERIALS[name]


DULL = "matte"
"""The material that has the albedo where only an albedo is told."""


def told_material(name: str | None = None, albedo: float | Sequence[float] | None = None) -> Material | None:
    """A material by its name, by its albedo, or by both; None where nothing is told.

    Args:
        name: one of MATERIALS; none with an albedo is DULL.
        albedo: linear, one number or three, in (0, 1]; takes the place of the named material's.
    Raises:
        InputError: another name or albedo, or an albedo for a metal, which has none.
    """
    if name is None and albedo is None:
        return None
    material = material_named(DULL if name is None else name)
    if albedo is None:
        return material
    values = np.asarray(albedo, np.float64).reshape(-1)
    if values.size not in (1, 3) or not ((values > 0) & (values <= 1)).all():
        raise InputError(
            f"albedo: expected one number or three above 0 and up to 1, got {', '.join(f'{v:g}' for v in values)}; "
            "a grey card has 0.18"
        )
    if not np.any(material.albedo):
        raise InputError(
            f"albedo: expected a material that has one, got the metal {name}; leave one of them out"
        )
    return replace(material, albedo=np.broadcast_to(values, 3).copy())
