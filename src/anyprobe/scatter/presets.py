"""Materials by name, for pictures of what a light does."""

from __future__ import annotations

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
