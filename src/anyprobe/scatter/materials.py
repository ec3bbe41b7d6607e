"""The paper's reflectance, Eq. 2: Lambert below a Cook-Torrance coat.

paper.equations evaluates it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe.paper.equations import reflectance


@dataclass(frozen=True, kw_only=True, slots=True)
class Material:
    """A uniform material.

    albedo: diffuse albedo in [0, 1], [3] or one number for all channels; zero for a metal.
    f0: reflectance at normal incidence in [0, 1], [3] or one number; grey and small for a dielectric.
    alpha: GGX width in [0.01, 1].
    """

    albedo: Any
    f0: Any
    alpha: float


def brdf(material: Material, wo, wi, n):
    """Evaluate f_r(wo, wi) [1/sr], paper Eq. 2; no cosine inside. [..., 3] each -> [..., 3]."""
    return reflectance(material.albedo, material.f0, material.alpha, wo, wi, n)


def total_reflectance(albedo, f0):
    """Return the total reflectance of a material under even light, [..., 3].

    Schlick's Fresnel term has the cosine-weighted mean F = f0 + (1 - f0) / 21; the rest meets the albedo. A rough
    coat's loss between its facets is left out.
    """
    fresnel = f0 + (1.0 - f0) / 21.0
    return fresnel + (1.0 - fresnel) * albedo


def _named(key: str) -> dict[str, Material]:
    return {
        name: Material(albedo=np.array(one["albedo"]), f0=np.array(one["f0"]), alpha=one["alpha"])
        for name, one in contract("materials")[key].items()
    }


PRESETS, MEASURED = _named("named"), _named("measured")
"""Named and measured materials.

Named: chrome reflects as chromium does (Johnson and Christy 1974, at 650, 550 and 450 nm), mirror reflects all light,
matte as much as objects do in the median (.29 of what a white sphere in their place would, in 277 rendered photos), and
plaster to rubber are typical of their kind. Measured: those of the Physically Based database (physicallybased.info,
CC0) that Material can express, see research.measured_materials.
"""
ELEMENTS = (
    "beryllium cesium cobalt germanium iridium lithium magnesium manganese mercury molybdenum palladium platinum "
    "potassium rubidium silicon sodium titanium tungsten vanadium zinc"
).split()
"""Measured materials that hardly any object is made of."""
MATERIALS: dict[str, Material] = (
    PRESETS | {name: one for name, one in MEASURED.items() if name not in ELEMENTS} | {n: MEASURED[n] for n in ELEMENTS}
)
"""Materials by name; chemical elements that few own are last."""


SEE_THROUGH = frozenset("glass crystal diamond ice snow water milk oil honey acrylic skin wax".split())
"""Words for materials that transmit light or scatter it below their surface, which Material cannot express."""


def material_named(name: str, *also: str) -> Material:
    """Return one of MATERIALS, upper or lower case; InputError names similar spellings and `also`, the other accepted
    values."""
    key = str(name).strip().lower().replace(" ", "-").replace("_", "-")
    if key in MATERIALS:
        return MATERIALS[key]
    advice = did_you_mean(key, [*MATERIALS, *also]) or "; `anyprobe materials` lists them"
    if not SEE_THROUGH.isdisjoint(key.split("-")):
        advice = "; materials that light passes through are left out"
    raise InputError(
        f"expected one of {', '.join([*PRESETS, *also])} or of {len(MEASURED)} measured ones, "
        f"got {str(name)[:60]!r}{advice}",
        subject="material",
    )


def alpha_from_roughness(roughness: float) -> float:
    """Convert a roughness of glTF, USD and engines to GGX alpha: its square (Burley 2012)."""
    return float(roughness) ** 2
