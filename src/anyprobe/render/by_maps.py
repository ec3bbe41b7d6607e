"""Shading by reflectance maps: some normals are shaded, every point looks itself up.

Under a distant light, from one side, radiance is nearly a function of the normal: a
perspective view only moves the lobe and changes its albedo, and how is known
(reflectance.stand_ins). So some hundred normals are shaded as in integrate.py, and
points read between them. Lamps, which no map so small could hold, are added to each
point by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.frames import normalize, orthonormal_basis
from anyprobe.light.octahedral import Pyramid
from anyprobe.render.compiled import compile_kernel
from anyprobe.render.integrate import lamps_specular, shade_diffuse, shade_specular
from anyprobe.render.reflectance import read_map, reflectance_normals, stand_ins
from anyprobe.scatter.albedo import albedo_table
from anyprobe.scatter.brdf import Material


def look_up(pyramid: Pyramid, terms, world_from_view, n, wo, alpha, table) -> tuple:
    """S1, Ss and, if there is a map of it, Dd at points.

    Args:
        terms: [S, S, 6 or 9]: S1, Ss, Dd of reflectance_normals(S); lamps in the last alone.
        world_from_view: [3, 3], +Z of the view towards the eye.   n, wo: [P, 3], world.   alpha: [P, 1].
        table: albedo_table() as an array of the same kind.
    Returns:
        [P, 3] each.
    """
    xp = array_namespace(n, terms)
    in_view = (n @ world_from_view, wo @ world_from_view)
    _, specular_xy, diffuse_xy, *gains = stand_ins(*in_view, alpha, table)
    found = read_map(terms, specular_xy, range(6))
    specular = xp.stack([channel * gains[0] for channel in found[:3]], axis=-1)
    grazing = xp.stack([channel * gains[1] for channel in found[3:]], axis=-1)
    if pyramid.lamps is not None:
        _, one, weak = lamps_specular(pyramid, n, wo, alpha)
        specular, grazing = specular + one, grazing + weak
    if terms.shape[2] == 6:
        return specular, grazing
    return specular, grazing, xp.stack(read_map(terms, diffuse_xy, range(6, 9)), axis=-1)


@dataclass(frozen=True, kw_only=True, slots=True)
class Kernels:
    """The functions that shade, as they are or compiled (for torch)."""

    specular: Callable = shade_specular
    diffuse: Callable = shade_diffuse
    look_up: Callable = look_up

    @classmethod
    def compiled(cls) -> Kernels:
        """Each by compile_kernel."""
        kernels = {"specular": shade_specular, "diffuse": shade_diffuse, "look_up": look_up}
        return cls(**{name: compile_kernel(kernel) for name, kernel in kernels.items()})


PLAIN = Kernels()


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
    kernels: Kernels = PLAIN,
) -> Any:
    """Lo [P, 3] of Eq. 3 at points with normals n seen from wo [P, 3], world frame.

    The maps are seen from the middle of all wo: the further one is from it, the less they hold. Where
    none is further than 15 degrees, sampled to convergence, it errs by 1 to 2 % of the mean for alpha of
    0.3 or more and by 1 to 5 % below (measured once under the two maps of benchmarks/README.md, by a script
    that is not kept; tests/physics/test_by_maps.py holds 0.9 % under a sky and a sun).

    Args:
        u, u_diffuse: [N, 2], samples of each normal; u_diffuse None for a metal, whose albedo is zero.
        size: of the maps, [size, size].
        wide: the light's pyramid for the diffuse term (integrate.shading_pyramid).
    """
    xp = array_namespace(n, wo, u)

    def array(values):
        return xp.asarray(np.ascontiguousarray(values, dtype=np.float32), device=n.device)

    middle = normalize(xp.mean(wo, axis=0))
    turn = xp.stack([*orthonormal_basis(middle), middle], axis=-1)
    seen = array(reflectance_normals(size).reshape(-1, 3)) @ turn.T
    toward_eye = seen * 0.0 + middle
    width = xp.full((seen.shape[0], 1), material.alpha, dtype=n.dtype, device=n.device)
    _, *terms = kernels.specular(pyramid.without_lamps(), seen, toward_eye, width, u)
    if u_diffuse is not None:
        terms.append(kernels.diffuse(wide or pyramid, seen, toward_eye, u_diffuse))
    terms = xp.reshape(xp.concat(terms, axis=-1), (size, size, -1))
    width = xp.full((n.shape[0], 1), material.alpha, dtype=n.dtype, device=n.device)
    specular, grazing, *diffuse = kernels.look_up(pyramid, terms, turn, n, wo, width, array(albedo_table()))
    f0 = array(material.f0)
    radiance = f0 * specular + (1.0 - f0) * grazing
    for term in diffuse:
        radiance = radiance + array(material.albedo) * (1.0 - f0) * term
    return radiance
