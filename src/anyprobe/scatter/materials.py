"""Materials of the paper's reflectance, Eq. 2, Lambert below a Cook-Torrance coat: by name, given, for networks.

paper.equations evaluates the reflectance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError


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
"""Named and measured materials: `named` and `measured` of `materials` in contract.json.

Named: chrome reflects as chromium does (Johnson and Christy 1974, at 650, 550 and 450 nm), mirror reflects all light,
matte as much as objects do in the median (.29 of what a white sphere in their place would, in 277 rendered photos), and
plaster to rubber are typical of their kind. Gold's f0 is the usual one of metal/roughness shaders, (1, .766, .336),
rounded; the alphas of gold, plastic and satin are our own choice. Measured: those of the Physically Based database
(physicallybased.info, CC0) that Material can express, see research.measured_materials.
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
    named = f"expected one of {', '.join([*PRESETS, *also])} or of {len(MEASURED)} measured ones"
    raise InputError(f"{named}, got {str(name)[:60]!r}{advice}", subject="material")


Albedo = float | Sequence[float]
"""Linear albedo: one number for grey, or red, green and blue."""

MATERIAL_INPUTS: int = contract("materials")["inputs"]
"""Count of numbers that encode a material for a network."""
LEAST_REFLECTANCE: float = contract("materials")["least_reflectance"]
"""Lower bound that darker reflectances are raised to: a hollow of black velvet."""


def material_input(material: Material) -> np.ndarray:
    """Encode a material for the networks, [8] float32: 1, sqrt(alpha), ln of total reflectance and of f0, RGB each.

    All zeros stand for an unknown material.
    """
    albedo, f0 = (np.broadcast_to(np.asarray(one, np.float32), 3) for one in (material.albedo, material.f0))
    reflected = np.log(np.maximum(total_reflectance(albedo, f0), LEAST_REFLECTANCE))
    return np.concatenate([[1.0, np.sqrt(float(material.alpha))], reflected, f0]).astype(np.float32)


MATTE = "matte"
"""Default material where only albedo or roughness is given."""
LEAST_ROUGHNESS: float = contract("materials")["least_roughness"]
"""Smallest roughness: below it a lobe is narrower than any pixel."""


def as_material(
    material: Material | str | None = None, albedo: Albedo | None = None, roughness: float | None = None
) -> Material | None:
    """Return the object's material from any of a Material, a name, albedo, roughness; None where nothing is given.

    Args:
        material: a Material, or one of MATERIALS; None with an albedo or a roughness is MATTE.
        albedo: linear, one number or three, in (0, 1]; replaces the named material's.
        roughness: 0.1 to 1; replaces the named material's.
    Raises:
        InputError: neither a material nor a name, values impossible for a surface, or an albedo beside a Material or
            for a metal, which has none.
    """
    if material is None and albedo is None and roughness is None:
        return None
    if isinstance(material, Material):
        if albedo is not None or roughness is not None:
            raise InputError(
                "albedo, roughness: expected a material's name beside it or none, got a Material, which has its own; "
                "leave one of them out"
            )
        return _checked(material)
    if not isinstance(material, str | None):
        raise InputError(
            f"expected a Material or one of {', '.join(PRESETS)} or a measured one's name, "
            f"got {type(material).__name__}; "
            "give an albedo alone as albedo=",
            subject="material",
        )
    found = material_named(MATTE if material is None else material)
    if roughness is not None:
        if not LEAST_ROUGHNESS <= roughness <= 1:
            text = f"expected a number from {LEAST_ROUGHNESS:g} to 1, got {roughness:g}; 0.1 is polished, 1 is matte"
            raise InputError(text, subject="roughness")
        found = replace(found, alpha=float(roughness) ** 2)  # Burley 2012
    if albedo is None:
        return found
    try:
        values = np.asarray(albedo, np.float64).reshape(-1)
    except (TypeError, ValueError) as error:
        text = f"expected one number or three, got {' '.join(repr(albedo).split())}"
        raise InputError(text, subject="albedo") from error
    if values.size not in (1, 3) or not ((values > 0) & (values <= 1)).all():
        raise InputError(
            f"expected one number or three above 0 and up to 1, got {', '.join(f'{v:g}' for v in values)}; "
            "a grey card has 0.18",
            subject="albedo",
        )
    if not np.any(found.albedo):
        text = f"expected a material that has one, got the metal {material}; leave one of them out"
        raise InputError(text, subject="albedo")
    return replace(found, albedo=np.broadcast_to(values, 3).copy())


def _checked(material: Material) -> Material:
    """Return a copy with arrays for its numbers; InputError where no surface has such values."""
    albedo, f0, alpha = material.albedo, material.f0, material.alpha
    try:
        colors = np.stack([np.broadcast_to(np.asarray(one, np.float64), 3) for one in (albedo, f0)])
        alpha = float(alpha)
    except (TypeError, ValueError):
        colors = np.full((2, 3), np.nan)
    if not (((colors >= 0) & (colors <= 1)).all() and 0.01 <= alpha <= 1):  # NaN fails too
        raise InputError(
            f"expected albedo and f0 of one number or three in 0 to 1 and alpha in 0.01 to 1, "
            f"got {' '.join(f'{albedo}, {f0} and {alpha}'.split())}",
            subject="material",
        )
    return Material(albedo=colors[0], f0=colors[1], alpha=alpha)
