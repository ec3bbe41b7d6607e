"""The test set: photos of held-out shapes under held-out maps, point by point in perspective.

Seeded and fixed: case k depends on (seed, k) and on the sorted lists of assets alone.
Nothing here is a lookup in a reflectance map, as training pairs are: every visible
point is shaded by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.core.sampling import hammersley
from anyprobe.dataset.camera import draw_shot, exposure
from anyprobe.dataset.catalog import MapAsset, ShapeAsset
from anyprobe.dataset.material import draw_alpha, draw_material
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.light.octahedral import Pyramid, build_pyramid
from anyprobe.render.integrate import shade
from anyprobe.render.surface import Surface, frame_object, see

NUM_SAMPLES = 128
VIEWPOINTS = 23
"""Camera positions on the upper hemisphere, as in the paper."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """One test pair: photo [S, S, 4], irradiance [S, S, 3] display, radiance [64, 128, 3]
    in the photo's exposure units and the camera's frame, and what it was made of."""

    photo: np.ndarray
    irradiance: np.ndarray
    radiance: np.ndarray
    map_name: str
    shape_name: str
    alpha: float
    specular: bool
    indoor: bool


def fibonacci_viewpoint(index: int, count: int = VIEWPOINTS) -> tuple[float, float]:
    """Yaw and elevation [radians] of one of count points spread evenly over the upper hemisphere."""
    return float(index * np.pi * (3.0 - np.sqrt(5.0))), float(np.arcsin((index + 0.5) / count))


def draw_cases(
    maps: list[MapAsset], shapes: list[ShapeAsset], count: int, seed: int = 2020
) -> Iterator[Case]:
    """Cases in turn specular/diffuse and indoor/outdoor; only one kind of place if the maps have no other."""
    pyramids: dict[str, Pyramid] = {}
    by_place = {place: [m for m in maps if m.indoor == place] or maps for place in (True, False)}
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        asset = by_place[bool(k // 2 % 2)][rng.integers(len(by_place[bool(k // 2 % 2)]))]
        if asset.name not in pyramids:
            pyramids[asset.name] = build_pyramid(asset.radiance)
        shape = shapes[k // 4 % len(shapes)]
        yield _make_case(asset, pyramids[asset.name], shape, k % 2 == 0, rng)


def _make_case(
    asset: MapAsset, pyramid: Pyramid, shape: ShapeAsset, specular: bool, rng: np.random.Generator
) -> Case:
    yaw, elevation = fibonacci_viewpoint(int(rng.integers(VIEWPOINTS)))
    turned = world_from_camera(yaw + rng.uniform(0, 2 * np.pi), elevation)
    camera = frame_object(shape.mesh, turned, fov_deg=rng.uniform(10.0, 45.0))
    surface = see(shape.mesh, camera)
    material = draw_material(rng, draw_alpha(rng, specular))
    # the map turns about the shape, so that shape and light are not tied together
    spin = world_from_camera(rng.uniform(0, 2 * np.pi), 0.0)
    map_from_camera = spin @ camera.world_from_camera
    shading = shade_surface(pyramid, surface, map_from_camera, material.alpha)
    reflected = shading.radiance(material)
    light = shrink(rotate(asset.radiance, map_from_camera.T), MAP_HEIGHT)
    shot = draw_shot(rng)
    scene = float(np.exp(np.log(np.maximum(luminance(light), 1e-4)).mean()))
    gain = exposure(shot, float(luminance(reflected).mean()), scene) * shot.white_balance
    display = response(reflected * gain, shot.curve) + rng.normal(0.0, 1.0, reflected.shape) * shot.noise
    photo = np.zeros((*surface.mask.shape, 4), np.float32)
    photo[surface.mask, :3] = np.round(np.clip(display, 0.0, 1.0) * 255.0) / 255.0
    photo[surface.mask, 3] = 1.0
    irradiance = np.zeros((*surface.mask.shape, 3), np.float32)
    irradiance[surface.mask] = response(shading.irradiance * gain, MEAN_CURVE)
    return Case(
        photo=photo,
        irradiance=irradiance,
        radiance=np.asarray(light * gain, np.float32),
        map_name=asset.name,
        shape_name=shape.name,
        alpha=material.alpha,
        specular=specular,
        indoor=asset.indoor,
    )


def shade_surface(pyramid: Pyramid, surface: Surface, map_from_camera: np.ndarray, alpha: float):
    """Shade every visible point under a map whose frame is map_from_camera away."""
    turn = map_from_camera.T.astype(np.float32)
    return shade(pyramid, surface.normals @ turn, surface.wo @ turn, float(alpha), hammersley(NUM_SAMPLES))
