"""A picture of a mesh under a map: linear radiance and coverage, split-sum shading, soft edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from array_api_compat import array_namespace, device

from anyprobe.core.frames import normalize, orthonormal_basis
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import reduced
from anyprobe.light.octahedral import Pyramid
from anyprobe.render.integrate import PATCHES, emitters_specular, shade_diffuse, shade_specular, shading_pyramid
from anyprobe.render.mesh import Mesh
from anyprobe.render.reflectance import albedo_table, lookup_coords, read_map, reflectance_normals
from anyprobe.render.surface import Camera, see
from anyprobe.scatter.materials import Material

if TYPE_CHECKING:
    from jaxtyping import Float


def look_up(pyramid: Pyramid, terms, world_from_view, n, wo, alpha, table) -> tuple:
    """Look up S1, Ss and, if there is a map of it, Dd at points.

    Args:
        terms: [S, S, 6 or 9]: S1, Ss, Dd of reflectance_normals(S); emitters only in the last.
        world_from_view: [3, 3], +Z of the view towards the eye.   n, wo: [P, 3], world.   alpha: [P, 1].
        table: albedo_table() as an array of the same kind.
    Returns:
        [P, 3] each.
    """
    xp = array_namespace(n, terms)
    in_view = (n @ world_from_view, wo @ world_from_view)
    _, specular_xy, diffuse_xy, *gains = lookup_coords(*in_view, alpha, table)
    found = read_map(terms, specular_xy, range(6))
    specular = xp.stack([channel * gains[0] for channel in found[:3]], axis=-1)
    grazing = xp.stack([channel * gains[1] for channel in found[3:]], axis=-1)
    if pyramid.emitters is not None:
        _, one, weak = emitters_specular(pyramid, n, wo, alpha)
        specular, grazing = specular + one, grazing + weak
    if terms.shape[2] == 6:
        return specular, grazing
    return specular, grazing, xp.stack(read_map(terms, diffuse_xy, range(6, 9)), axis=-1)


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
    (tests/physics/test_reflectance.py: 0.9 % of the mean under a sky and a sun, where none is further than 15 degrees).

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


NUM_SAMPLES = 64
SUPERSAMPLE = 3
CHUNK = 4096
MAPS_FROM = 0.3
"""Smallest alpha of materials that are looked up in reflectance maps of side MAP_SIZE, if points are more."""
MAP_SIZE = 48
CREASE, ALONE_SAMPLES = 0.95, 16
"""Length of the mean of a pixel's unit normals below which they are shaded one by one, with so many samples each: over
a crease of 36 degrees the mean of two faces faces nowhere, and a metal would mirror there what neither face does. So
are normals that vary more than a narrow lobe is wide."""
LIGHT_ROWS = 256
"""Rows of the light that is drawn with: a pyramid samples a larger map at points and misses what lies between."""


def draw_mesh(
    mesh: Mesh,
    camera: Camera,
    radiance: Float[np.ndarray, "H 2*H 3"],
    material: Material,
    num_samples: int = NUM_SAMPLES,
    supersample: int = SUPERSAMPLE,
) -> Float[np.ndarray, "S S 4"]:
    """Draw the mesh as the camera sees it, under distant light and without shadows.

    A pixel's coverage is that of supersample^2 points; it is shaded once, with the mean of their normals, or where
    these vary point by point; directly or, where that is as good, by reflectance maps.

    Args:
        camera: in the mesh's frame.
        radiance: [H, 2H, 3] linear, in the same frame; more than LIGHT_ROWS rows are averaged down.
    Returns:
        [S, S, 4] float32: linear radiance in the map's units, 0 where there is nothing, and coverage in [0, 1].
        The radiance is the object's own, not multiplied by the coverage.
    """
    size = camera.size
    fine = see(mesh, replace(camera, size=size * supersample))
    row, column = np.nonzero(fine.mask)
    pixel = row // supersample * size + column // supersample
    count = np.bincount(pixel, minlength=size * size)
    crease = max(CREASE, 1.0 - material.alpha**2 / 2)
    point, of_point, share = _shaded_points(fine.normals, pixel, count, crease)
    n, wo = (_mean_direction(v, point, len(of_point)) for v in (fine.normals, fine.wo))
    turn = np.asarray(camera.world_from_camera, np.float32).T
    n, wo = n @ turn, wo @ turn
    light, u = reduced(np.asarray(radiance, np.float32), LIGHT_ROWS), hammersley(num_samples)
    wide = shading_pyramid(light)
    pyramid = wide if material.alpha >= PATCHES[0][0] else shading_pyramid(light, material.alpha)
    picture = np.zeros((size * size, 4), np.float32)
    picture[:, 3] = count / supersample**2
    if material.alpha >= MAPS_FROM and len(of_point) > MAP_SIZE**2:
        u_diffuse = u if np.any(material.albedo) else None  # a metal has none
        shaded = radiance_by_maps(pyramid, n, wo, material, u, u_diffuse, size=MAP_SIZE, wide=wide)
    else:
        shaded = np.zeros((len(of_point), 3), np.float32)
        for group, samples in ((share == 1, u), (share < 1, hammersley(ALONE_SAMPLES))):
            for first in range(0, int(group.sum()), CHUNK):
                some = np.flatnonzero(group)[first : first + CHUNK]
                _, specular, grazing = shade_specular(pyramid, n[some], wo[some], material.alpha, samples)
                shaded[some] = material.f0 * specular + (1.0 - material.f0) * grazing
                if np.any(material.albedo):
                    diffuse = shade_diffuse(wide, n[some], wo[some], samples)
                    shaded[some] += material.albedo * (1.0 - material.f0) * diffuse
    for channel in range(3):
        picture[:, channel] = np.bincount(of_point, share * shaded[:, channel], size * size)
    return picture.reshape(size, size, 4)


def _shaded_points(
    normals: Float[np.ndarray, "P 3"], pixel: np.ndarray, count: np.ndarray, crease: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Group samples of unit normals [P, 3], each in a pixel [P] of count [S * S] samples, into points to be shaded.

    Returns:
        The point of each sample [P]; the pixel of each point [N], and its share of that pixel's samples [N].
    """
    total = np.stack([np.bincount(pixel, normals[:, k], len(count)) for k in range(3)], axis=-1)
    is_creased = np.linalg.norm(total, axis=-1) < crease * count
    own = np.where(is_creased[pixel], len(count) + np.arange(len(pixel)), pixel)
    _, first, point, samples = np.unique(own, return_index=True, return_inverse=True, return_counts=True)
    of_point = pixel[first]
    return point, of_point, (samples / count[of_point]).astype(np.float32)


def _mean_direction(vectors: np.ndarray, pixel: np.ndarray, count: int) -> np.ndarray:
    """Return unit means [count, 3] of the vectors [P, 3] that fall into each pixel [P]."""
    total = np.stack([np.bincount(pixel, vectors[:, k], count) for k in range(3)], axis=-1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return (total / np.maximum(length, 1e-12)).astype(np.float32)
