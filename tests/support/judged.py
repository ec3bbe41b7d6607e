"""What both renderers are shown by the judge, and how each makes its picture.

Our side is the production shading under the unfolded map as it is, without its blurred levels
(num_levels = 1): those trade noise for bias, and only without them does the mean have to be
right to the last digit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from support.mitsuba_scenes import mitsuba_scene, pixel_centres, surface_at, trace
from support.zscore import Measured, measured

from anyprobe.core.frames import world_from_camera
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import reduced
from anyprobe.light.octahedral import Pyramid, build_pyramid
from anyprobe.maps.radiance import read_radiance
from anyprobe.render.integrate import Shading, shade
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import Camera, frame_object, see
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.asset_store import room, sky, studio
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.dataset.random_shapes import lathe, superquadric

SIZE = 32
ROWS = 32
"""Of the maps: the smaller a sun, the fewer of our samples find it (with 256 rows, 12 times brighter)."""

OURS = (64, 2048)
THEIRS = (32, 1024)
"""Replicates x samples in a pixel."""

SIDE = 512
"""Texels along level 0, twice the usual: 256 lose 0.6 % of the brightest pixel, which the judge sees."""

TOLERANCE = 0.0005
"""Of the radiance: what unfolding the map onto the octahedron changes (test_unfolded_map_is_another)."""

GRAZING = 0.03
"""n.wo below which our normals are bent back to the silhouette and Mitsuba's are not."""

MATERIALS = {
    "plastic-0.5": Material(albedo=np.array([0.7, 0.4, 0.1]), f0=np.full(3, 0.04), alpha=0.5),
    "plastic-0.15": Material(albedo=np.array([0.1, 0.3, 0.6]), f0=np.full(3, 0.07), alpha=0.15),
    "metal-0.1": Material(albedo=np.zeros(3), f0=np.array([1.0, 0.77, 0.34]), alpha=0.1),
    "metal-0.3": Material(albedo=np.zeros(3), f0=np.array([0.91, 0.92, 0.92]), alpha=0.3),
    "metal-1": Material(albedo=np.zeros(3), f0=np.array([0.96, 0.64, 0.54]), alpha=1.0),
}

SCENES = [
    ("sphere", "plastic-0.5", "sky"),
    ("sphere", "plastic-0.15", "room"),
    ("sphere", "metal-0.3", "studio"),
    ("rounded", "plastic-0.5", "studio"),
    ("rounded", "metal-0.1", "sky"),
    ("rounded", "metal-1", "room"),
    ("vase", "plastic-0.15", "sky"),
    ("vase", "metal-1", "studio"),
    ("vase", "metal-0.3", "room"),
    ("sphere", "metal-0.1", "real-0"),
    ("rounded", "plastic-0.15", "real-1"),
    ("vase", "plastic-0.5", "real-2"),
]
NUM_TESTS = len(SCENES) * SIZE * SIZE * 3

BRIGHTEST = {"sky": (30, 120), "room": (20, 120), "studio": (8, 60)}
"""Of a map of mean 1: high enough for a sun or an emitter, low enough for our samples to find it."""


@lru_cache
def made_map(family: str, rows: int = ROWS) -> np.ndarray:
    """The first drawn map of its family whose brightest texel is in bounds."""
    draw = {"sky": sky, "room": room, "studio": studio}[family]
    low, high = BRIGHTEST[family]
    for seed in range(200):
        radiance = draw(np.random.default_rng(seed))
        if low < reduced(radiance, ROWS).max() < high:
            return reduced(radiance, rows)
    raise AssertionError(f"no {family} of 200 has its brightest texel in {low} to {high}")


@lru_cache
def real_maps() -> list[np.ndarray]:
    """Up to three of ANYPROBE_MAPS, chosen as above."""
    folder = Path(os.environ.get("ANYPROBE_MAPS", "none"))
    found = []
    for path in sorted(folder.glob("*.exr")) + sorted(folder.glob("*.hdr")):
        radiance = read_radiance(path)
        if radiance.shape[0] % ROWS == 0:
            radiance = normalize_map(reduced(radiance, ROWS))
            found += [radiance] if 15 < radiance.max() < 100 else []
        if len(found) == 3:
            break
    return found


@lru_cache
def object_of(name: str) -> tuple[Mesh, Camera]:
    """A mesh and a camera that stands askew to every axis."""
    mesh = {
        "sphere": lambda: sphere(),
        "rounded": lambda: superquadric(np.random.default_rng(4)),
        "vase": lambda: lathe(np.random.default_rng(2)),
    }[name]()
    turned = world_from_camera(0.7, 0.4, 0.2)
    return mesh, frame_object(mesh, turned, fov_deg=30.0, size=SIZE)


class Sight:
    """The points that both renderers see: mask [S, S], n and wo [P, 3] in the world, by our rasteriser."""

    def __init__(self, mesh: Mesh, camera: Camera, scene, least_cosine: float = GRAZING):
        surface = see(mesh, camera)
        at = pixel_centres(camera.size)
        hit, normals = surface_at(scene, at)
        hit = hit.reshape(surface.mask.shape)
        assert (hit != surface.mask).sum() <= 0.01 * surface.mask.sum()
        cosine = (surface.normals * surface.wo).sum(axis=1)
        kept = hit[surface.mask] & (cosine > least_cosine)
        assert least_cosine > GRAZING or kept.mean() > 0.97
        self.mask = surface.mask.copy()
        self.mask[surface.mask] = kept
        turn = camera.world_from_camera.T.astype(np.float32)
        self.n, self.wo = surface.normals[kept] @ turn, surface.wo[kept] @ turn
        self.at = at[self.mask.reshape(-1)]
        theirs = normals[self.mask.reshape(-1)]
        np.testing.assert_allclose(self.n, theirs, atol=1e-4, err_msg="not the same surface")


def our_replicates(
    pyramid: Pyramid, sight: Sight, alpha: float, picture: Callable[[Shading], np.ndarray], count: int, samples: int
) -> np.ndarray:
    """Shifted Hammersley sets as replicates, [count, P, 3]."""
    shifts = np.random.default_rng(2020).random((count, 2, 2))

    def replicate(shift):
        u, u_diffuse = hammersley(samples, shift[0]), hammersley(samples, shift[1])
        few = range(0, len(sight.n), 16)  # points at a time: what fits the cache
        parts = [picture(shade(pyramid, sight.n[k : k + 16], sight.wo[k : k + 16], alpha, u, u_diffuse)) for k in few]
        return np.concatenate(parts)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.array(list(pool.map(replicate, shifts)))


def our_picture(radiance: np.ndarray, sight: Sight, material: Material) -> Measured:
    pyramid = replace(build_pyramid(radiance, side=SIDE), num_levels=1)
    count, samples = OURS
    found = our_replicates(pyramid, sight, material.alpha, lambda s: s.radiance(material), count, samples)
    one_hit = radiance.max() * (material.f0 + material.albedo) / (count * samples)
    return measured(found, largest=one_hit)


def their_picture(scene, at: np.ndarray, integrator: dict | None = None) -> Measured:
    count, samples = THEIRS
    return measured(np.array([trace(scene, at, samples, k, integrator)[0].mean(axis=1) for k in range(count)]))


def scene_for(name: str, radiance: np.ndarray, bsdf: dict, least_cosine: float = GRAZING):
    mesh, camera = object_of(name)
    scene = mitsuba_scene(mesh, camera, radiance, bsdf)
    return scene, Sight(mesh, camera, scene, least_cosine)
