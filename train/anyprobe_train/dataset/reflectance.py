"""Reflectance maps: with distant light and one view direction, radiance depends on the normal alone.

A picture [S, S] over the visible hemisphere of normals (camera frame, wo = +Z), radius
proportional to the angle between n and +Z, so that equal steps turn the mirror direction
equally. One such map serves every shape of that material under that light by a lookup.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from array_api_compat import array_namespace, device

from anyprobe.core.frames import dot, normalize, orthonormal_basis, reflect
from anyprobe.core.latlong import corners
from anyprobe.core.sampling import ggx_visible_normal_xyz, hammersley
from anyprobe.light.octahedral import Pyramid
from anyprobe.paper.equations import schlick_weight, smith_visibility
from anyprobe.render.integrate import emitters_specular, shade_diffuse, shade_specular
from anyprobe.scatter.materials import Material

if TYPE_CHECKING:
    from jaxtyping import Float

COSINES, ROUGHNESSES = 64, 32
"""Number of entries from n.wo = 0 to 1 and from sqrt(alpha) = 0.1 to 1."""
SAMPLES = 512


@lru_cache(maxsize=1)
def albedo_table() -> Float[np.ndarray, "ROUGHNESSES COSINES 2"]:
    """Tabulate E1 and Es, [ROUGHNESSES, COSINES, 2] float32: an even light's share that the coat sends to the eye, by
    n.wo and alpha alone, is f0 E1 + (1 - f0) Es (Karis 2013 keeps them in a picture).

    Half vectors follow the normals that the eye sees; the weight of each is then G / G1.
    """
    u = hammersley(SAMPLES).astype(np.float64)
    alpha = (np.linspace(0.1, 1.0, ROUGHNESSES) ** 2)[:, None, None]
    cosine = np.maximum(np.linspace(0.0, 1.0, COSINES), 1e-3)[None, :, None]
    sine = np.sqrt(1.0 - cosine**2)
    x, _, z = ggx_visible_normal_xyz(u, sine, 0.0 * sine, cosine, alpha)
    wo_dot_h = x * sine + z * cosine
    n_dot_wi = np.maximum(2.0 * wo_dot_h * z - cosine, 0.0)
    # G1 = 2 (n.wo) / (n.wo + sqrt(alpha^2 + (1 - alpha^2) (n.wo)^2)), G = 4 (n.wo) (n.wi) V
    inverse_g1 = cosine + np.sqrt(alpha**2 + (1.0 - alpha**2) * cosine**2)
    weight = 2.0 * n_dot_wi * smith_visibility(cosine, n_dot_wi, alpha) * inverse_g1
    return np.stack([weight.mean(axis=2), (weight * schlick_weight(wo_dot_h)).mean(axis=2)], axis=-1).astype(np.float32)


def directional_albedo(n_dot_wo, alpha, table):
    """Interpolate E1 and Es in albedo_table (an array of the same kind), in the joint shape of n_dot_wo and alpha;
    beyond the table its edge continues."""
    xp = array_namespace(n_dot_wo, table)
    column = xp.clip(n_dot_wo * (COSINES - 1), 0.0, COSINES - 1.001)
    row = xp.clip((alpha**0.5 - 0.1) * ((ROUGHNESSES - 1) / 0.9), 0.0, ROUGHNESSES - 1.001) + 0.0 * column
    column = column + 0.0 * row
    flat = xp.reshape(table, (-1, 2))
    weighted = corners(column, row, COSINES)
    return tuple(sum(flat[index, kind] * share for index, share in weighted) for kind in range(2))


LIMIT = 0.995
"""Angle of the rim as a share of 90 degrees; at 90 nothing is seen."""
ALBEDO_FLOOR = 1e-3
"""Albedo added to both terms of a quotient: Ss vanishes before a smooth mirror."""


@lru_cache(maxsize=8)
def reflectance_normals(size: int) -> Float[np.ndarray, "S S 3"]:
    """Return the normal of every pixel, [S, S, 3]; outside the disc the rim's normal."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    right, up = np.meshgrid(x, -x)
    radius = np.hypot(right, up)
    theta = np.minimum(radius, LIMIT) * np.pi / 2
    scale = np.sin(theta) / np.maximum(radius, 1e-9)
    return np.stack([right * scale, up * scale, np.cos(theta)], axis=-1).astype(np.float32)


def normal_to_reflectance_xy(n):
    """Map normals to places in a reflectance map: (x right, y down) in [-1, 1], [..., 3] -> [..., 2]."""
    xp = array_namespace(n)
    sine = xp.sqrt(xp.clip(n[..., 0] ** 2 + n[..., 1] ** 2, 1e-12, None))
    radius = xp.atan2(sine, n[..., 2]) / (np.pi / 2)
    radius = xp.clip(radius, None, LIMIT)
    return xp.stack([n[..., 0] / sine * radius, -n[..., 1] / sine * radius], axis=-1)


def straight_on_normal(n, wo):
    """Return the normal that, seen along +Z, mirrors the same direction as n seen from wo.

    It replaces n before a mirror when the view is perspective.
    """
    reflected = reflect(wo, n)
    xp = array_namespace(n)
    forward = xp.stack([reflected[..., 0], reflected[..., 1], reflected[..., 2] + 1.0], axis=-1)
    return normalize(forward)


def lobe_normal(n, wo, alpha):
    """Return the normal whose lobe, seen along +Z, is centred where n's is when seen from wo; [..., 3] each.

    It replaces n in the specular terms. A narrow lobe lies about the mirror direction, a wide one
    about n: between them by (1 - alpha) (sqrt(1 - alpha) + alpha), Lagarde and de Rousiers 2014, Sect. 4.9.3; alpha is
    a number or [..., 1]. Its albedo differs from n's: see directional_albedo.
    """
    mirrored = (1.0 - alpha) * ((1.0 - alpha) ** 0.5 + alpha)
    return normalize(n + mirrored * (straight_on_normal(n, wo) - n))


def read_disc(picture, xy, channels) -> list:
    """Interpolate channels of a map [S, S, C] at xy [..., 2] in [-1, 1], [...] each."""
    xp = array_namespace(picture, xy)
    size = picture.shape[0]
    flat = xp.reshape(picture, (size * size, -1))
    column, row = (xp.clip((xy[..., k] + 1.0) * (size / 2) - 0.5, 0.0, size - 1.001) for k in range(2))
    weighted = corners(column, row, size)
    return [sum(flat[index, channel] * share for index, share in weighted) for channel in channels]


def look_up(pyramid: Pyramid, terms, world_from_view, n, wo, alpha, table) -> tuple:
    """Look up S1, Ss and, if there is a map of it, Dd at points.

    A lobe is found elsewhere in the maps, which are seen along +Z; n has its own albedo.

    Args:
        terms: [S, S, 6 or 9]: S1, Ss, Dd of reflectance_normals(S); emitters only in the last.
        world_from_view: [3, 3], +Z of the view towards the eye.   n, wo: [P, 3], world.   alpha: [P, 1].
        table: albedo_table() as an array of the same kind.
    Returns:
        [P, 3] each.
    """
    xp = array_namespace(n, terms)
    seen, toward_eye = n @ world_from_view, wo @ world_from_view
    lobe = lobe_normal(seen, toward_eye, alpha)
    own = directional_albedo(dot(seen, toward_eye)[..., 0], alpha[..., 0], table)
    there = directional_albedo(lobe[..., 2], alpha[..., 0], table)
    gains = [(a + ALBEDO_FLOOR) / (b + ALBEDO_FLOOR) for a, b in zip(own, there, strict=True)]
    found = read_disc(terms, normal_to_reflectance_xy(lobe), range(6))
    specular = xp.stack([channel * gains[0] for channel in found[:3]], axis=-1)
    grazing = xp.stack([channel * gains[1] for channel in found[3:]], axis=-1)
    if pyramid.emitters is not None:
        _, one, weak = emitters_specular(pyramid, n, wo, alpha)
        specular, grazing = specular + one, grazing + weak
    if terms.shape[2] == 6:
        return specular, grazing
    diffuse = read_disc(terms, normal_to_reflectance_xy(seen), range(6, 9))
    return specular, grazing, xp.stack(diffuse, axis=-1)


SHADERS = (shade_specular, shade_diffuse, look_up)
"""Functions that radiance_by_maps shades by; a caller may have them compiled (for torch)."""


def radiance_by_maps(
    pyramid: Pyramid,
    n,
    wo,
    material: Material,
    u,
    u_diffuse=None,
    *,
    size: int,
    wide: Pyramid | None = None,
    shaders: tuple[Callable, ...] = SHADERS,
) -> Any:
    """Compute Lo [P, 3] of Eq. 3 at points with normals n seen from wo [P, 3], world frame.

    The maps are made for the mean of all wo and hold less the further a view is from it
    (tests/learning/test_reflectance.py: 0.9 % of the mean under a sky and a sun, if none is further than 15 degrees).

    Args:
        u, u_diffuse: [N, 2], samples of each normal; u_diffuse None for a metal, whose albedo is zero.
        size: of the maps, [size, size]. wide: the light's pyramid for the diffuse term (integrate.shading_pyramid).
    """
    xp, (specular_by, diffuse_by, look_up_by) = array_namespace(n, wo, u), shaders

    def array(values):
        return xp.asarray(np.ascontiguousarray(values, dtype=np.float32), device=device(n))

    middle = normalize(xp.mean(wo, axis=0))
    turn = xp.stack([*orthonormal_basis(middle), middle], axis=-1)
    seen = array(reflectance_normals(size).reshape(-1, 3)) @ turn.T
    toward_eye = seen * 0.0 + middle
    width = xp.full((seen.shape[0], 1), material.alpha, dtype=n.dtype, device=device(n))
    rest = replace(pyramid, emitters=None, emitter_power=None, emitter_spread=None)  # the map without emitters
    _, *terms = specular_by(rest, seen, toward_eye, width, u)
    if u_diffuse is not None:
        terms.append(diffuse_by(wide or pyramid, seen, toward_eye, u_diffuse))
    terms = xp.reshape(xp.concat(terms, axis=-1), (size, size, -1))
    width = xp.full((n.shape[0], 1), material.alpha, dtype=n.dtype, device=device(n))
    specular, grazing, *diffuse = look_up_by(pyramid, terms, turn, n, wo, width, array(albedo_table()))
    f0 = array(material.f0)
    radiance = f0 * specular + (1.0 - f0) * grazing
    for term in diffuse:
        radiance = radiance + array(material.albedo) * (1.0 - f0) * term
    return radiance
