"""The paper's reflectance, Eq. 2: Lambert below a Cook-Torrance coat.

f_r = kd albedo / pi + D F G / (4 (n.wo)(n.wi)), kd = 1 - F, F by Schlick at wo.h.
Taking F at the half vector for both parts keeps f_r reciprocal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.contract import contract
from anyprobe.core.frames import dot, normalize
from anyprobe.errors import InputError
from anyprobe.scatter.microfacet import ggx_distribution, schlick_weight, smith_visibility

Albedo = float | Sequence[float]
"""Linear: one number for grey, or red, green and blue."""


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


def evaluate(material: Material, wo, wi, n):
    """f_r(wo, wi) [1/sr], paper Eq. 2; no cosine inside. [..., 3] each -> [..., 3]."""
    xp = array_namespace(wo, wi, n)
    h = normalize(wo + wi)
    n_dot_wo, n_dot_wi = dot(n, wo), dot(n, wi)
    s = schlick_weight(dot(wo, h))
    fresnel = material.f0 + (1.0 - material.f0) * s
    specular = (
        ggx_distribution(dot(n, h), material.alpha) * smith_visibility(n_dot_wo, n_dot_wi, material.alpha) * fresnel
    )
    value = (1.0 - fresnel) * material.albedo / np.pi + specular
    above = (n_dot_wo > 0) & (n_dot_wi > 0)
    return xp.where(above, value, xp.zeros_like(value))


def total_reflectance(albedo, f0):
    """What a material reflects of an even light in all, [..., 3].

    Schlick's Fresnel term has the cosine-weighted mean F = f0 + (1 - f0) / 21; the rest meets the albedo. What a rough
    coat loses between its facets is left out.
    """
    fresnel = f0 + (1.0 - f0) / 21.0
    return fresnel + (1.0 - fresnel) * albedo


MATERIAL_INPUTS: int = contract("materials")["inputs"]
"""Numbers by which a network is given a material."""
LEAST_REFLECTANCE: float = contract("materials")["least_reflectance"]
"""Darker than this is taken as this: a hollow of black velvet."""


def material_input(material: Material) -> np.ndarray:
    """A material as networks are given it, [8] float32: 1, sqrt(alpha), ln of the total reflectance and f0, each RGB.

    All zero stands for a material that is not known.
    """
    albedo, f0 = (np.broadcast_to(np.asarray(one, np.float32), 3) for one in (material.albedo, material.f0))
    reflected = np.log(np.maximum(total_reflectance(albedo, f0), LEAST_REFLECTANCE))
    return np.concatenate([[1.0, np.sqrt(float(material.alpha))], reflected, f0]).astype(np.float32)


def _named(key: str) -> dict[str, Material]:
    return {
        name: Material(albedo=np.array(one["albedo"]), f0=np.array(one["f0"]), alpha=one["alpha"])
        for name, one in contract("materials")[key].items()
    }


PRESETS, MEASURED = _named("named"), _named("measured")
"""Our own: chrome reflects as chromium does (Johnson and Christy 1974, at 650, 550 and 450 nm); and those of the
Physically Based database (physicallybased.info, CC0) that Material can express, see research.measured_materials."""
MATERIALS: dict[str, Material] = PRESETS | MEASURED
"""By name."""


def material_named(name: str, *also: str) -> Material:
    """One of MATERIALS, in small letters or large; InputError names those that are spelled alike, and what else the
    caller would have taken."""
    key = str(name).strip().lower().replace(" ", "-").replace("_", "-")
    if key in MATERIALS:
        return MATERIALS[key]
    alike = get_close_matches(key, [*MATERIALS, *also], n=3) or [one for one in MATERIALS if key and key in one][:3]
    advice = f"did you mean {' or '.join(alike)}?" if alike else "`anyprobe materials` lists them"
    raise InputError(
        f"material: expected one of {', '.join([*PRESETS, *also])} or of {len(MEASURED)} measured ones, "
        f"got {str(name)[:60]!r}; {advice}"
    )


MATTE = "matte"
"""The material that has the albedo or roughness where only these are given."""
LEAST_ROUGHNESS: float = contract("materials")["least_roughness"]
"""Below it a lobe is narrower than any pixel."""


def alpha_from_roughness(roughness: float) -> float:
    """GGX alpha of a roughness as glTF, USD and engines have it: its square (Burley 2012)."""
    return float(roughness) ** 2


def given_material(
    name: str | None = None, albedo: Albedo | None = None, roughness: float | None = None
) -> Material | None:
    """A material by its name, its albedo, its roughness or any of these; None where nothing is given.

    Args:
        name: one of MATERIALS; None with an albedo or a roughness is MATTE.
        albedo: linear, one number or three, in (0, 1]; replaces the named material's.
        roughness: 0.1 to 1; replaces the named material's.
    Raises:
        InputError: another name, albedo or roughness, or an albedo for a metal, which has none.
    """
    if name is None and albedo is None and roughness is None:
        return None
    material = material_named(MATTE if name is None else name)
    if roughness is not None:
        if not LEAST_ROUGHNESS <= roughness <= 1:
            raise InputError(
                f"roughness: expected a number from {LEAST_ROUGHNESS:g} to 1, got {roughness:g}; "
                "0.1 is polished, 1 is matte"
            )
        material = replace(material, alpha=alpha_from_roughness(roughness))
    if albedo is None:
        return material
    values = np.asarray(albedo, np.float64).reshape(-1)
    if values.size not in (1, 3) or not ((values > 0) & (values <= 1)).all():
        raise InputError(
            f"albedo: expected one number or three above 0 and up to 1, got {', '.join(f'{v:g}' for v in values)}; "
            "a grey card has 0.18"
        )
    if not np.any(material.albedo):
        raise InputError(f"albedo: expected a material that has one, got the metal {name}; leave one of them out")
    return replace(material, albedo=np.broadcast_to(values, 3).copy())


def as_material(
    material: Material | str | None = None, albedo: Albedo | None = None, roughness: float | None = None
) -> Material | None:
    """The object's material from what is given of it: itself, a name, an albedo, a roughness; None for nothing.

    Raises:
        InputError: neither a material nor a name, values that no surface has, or an albedo beside a Material.
    """
    if not isinstance(material, Material | str | None):
        raise InputError(
            f"material: expected a Material or one of {', '.join(PRESETS)} or a measured one's name, "
            f"got {type(material).__name__}; "
            "give an albedo alone as albedo="
        )
    try:
        values = None if albedo is None else [float(v) for v in np.asarray(albedo, np.float64).reshape(-1)]
    except (TypeError, ValueError) as error:
        raise InputError(f"albedo: expected one number or three, got {' '.join(repr(albedo).split())}") from error
    if not isinstance(material, Material):
        return given_material(material, values, roughness)
    if albedo is not None or roughness is not None:
        raise InputError(
            "albedo, roughness: expected a material's name beside it or none, got a Material, which has its own; "
            "leave one of them out"
        )
    return _checked(material)


def _checked(material: Material) -> Material:
    """The same with arrays for its numbers; InputError where they are no surface's."""
    albedo, f0, alpha = material.albedo, material.f0, material.alpha
    try:
        colors = np.stack([np.broadcast_to(np.asarray(one, np.float64), 3) for one in (albedo, f0)])
        alpha = float(alpha)
    except (TypeError, ValueError):
        colors = np.full((2, 3), np.nan)
    if not (((colors >= 0) & (colors <= 1)).all() and 0.01 <= alpha <= 1):  # NaN fails too
        raise InputError(
            f"material: expected albedo and f0 of one number or three in 0 to 1 and alpha in 0.01 to 1, "
            f"got {' '.join(f'{albedo}, {f0} and {alpha}'.split())}"
        )
    return Material(albedo=colors[0], f0=colors[1], alpha=alpha)
