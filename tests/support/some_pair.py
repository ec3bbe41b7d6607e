"""A test pair without a renderer: a sphere under a drawn map, its photo what the map makes of it."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.light.environment import reduced
from anyprobe.render.spheres import diffuse, sphere_normals
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.asset_store import draw_map
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.dataset.recipe import Recipe


def sphere_pair(seed: int = 0, alpha: float = 0.3, indoor: bool = True, material: int = 0) -> Pair:
    """A white sphere that fills the picture; photo and irradiance alike."""
    radiance = reduced(draw_map(np.random.default_rng(seed), height=64)[0], 64).astype(np.float32)
    radiance = radiance * np.float32(0.4 / radiance.mean())
    normals, mask = sphere_normals(128)
    picture = np.round(response(diffuse(radiance, 128)) * 255).astype(np.uint8)
    seen = np.zeros((128, 128, 3), np.float32)
    seen[mask] = normals
    return Pair(
        recipe=Recipe(map_id="0" * 8, shape_id="0" * 8, material=material, view=0, seed=seed),
        photo=np.concatenate([picture, mask[..., None] * np.uint8(255)], axis=-1),
        irradiance=picture,
        radiance=radiance,
        map_from_camera=np.eye(3),
        gain=np.ones(3, np.float32),
        tan_half=0.1,
        normals=seen,
        material=Material(albedo=np.full(3, 0.8), f0=np.full(3, 0.04), alpha=alpha),
        map_name=f"drawn {seed}",
        shape_name="sphere",
        indoor=indoor,
    )
