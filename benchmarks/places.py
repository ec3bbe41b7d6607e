"""Place (noun): one object in one light, photographed from several sides with exposure and white balance locked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y, world_from_camera
from anyprobe.dataset.camera import draw_shot, exposure, take_photo
from anyprobe.dataset.mask_errors import disturb_mask
from anyprobe.dataset.material import draw_alpha, draw_material
from anyprobe.dataset.pair import shade_surface
from anyprobe.dataset.stock import Stock
from anyprobe.infer.photo import Photo
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.render.surface import frame_object, see


@dataclass(frozen=True, kw_only=True, slots=True)
class Place:
    """radiance [64, 128, 3]: the light in the first camera's frame and exposure units; photos, and of each camera
    map_from_camera [N, 3, 3]."""

    radiance: np.ndarray
    photos: tuple[Photo, ...]
    map_from_camera: np.ndarray


def draw_place(stock: Stock, rng: np.random.Generator, count: int, arc_deg: float = 360.0) -> Place:
    """A random map, shape, material and camera, as the world gives them but for what is behind the object: black.

    Args:
        count: photos; the camera goes round the object, evenly.
        arc_deg: by so much from the first photo to the last, all round at 360, where the last is not the first again.
    """
    maps, shapes = list(stock.maps.values()), list(stock.shapes.values())
    asset, shape = maps[rng.integers(len(maps))], shapes[rng.integers(len(shapes))]
    material = draw_material(rng, draw_alpha(rng))
    yaw, map_yaw = rng.uniform(0, 2 * np.pi, 2)
    elevation, fov_deg = rng.uniform(0.05, 0.6), rng.uniform(15.0, 40.0)
    shot, step = draw_shot(rng), np.radians(arc_deg) / (count if arc_deg == 360 else max(count - 1, 1))
    photos, turns, gain, radiance = [], [], 0.0, None
    for k in range(count):
        camera = frame_object(shape.mesh, world_from_camera(yaw + k * step, elevation), fov_deg=fov_deg)
        surface = see(shape.mesh, camera)
        turns.append(rotation_y(map_yaw) @ camera.world_from_camera)
        shading = shade_surface(stock.pyramid(asset.id), surface, turns[-1], material.alpha)
        reflected = shading.radiance(material)
        if radiance is None:
            light = np.maximum(shrink(rotate(asset.radiance, turns[0].T), MAP_HEIGHT), 0.0)
            scene = float(np.exp(np.log(np.maximum(luminance(light), 1e-4)).mean()))
            gain = exposure(shot, float(luminance(reflected).mean()), scene)
            radiance = light * np.asarray(gain * shot.white_balance, np.float32)
        picture = np.zeros((*surface.mask.shape, 3), np.float32)
        picture[surface.mask] = reflected * gain
        display = take_photo(shot, picture, surface.mask, None, rng)
        photos.append(
            Photo(
                rgb=display.astype(np.float32) / 255,
                mask=disturb_mask(surface.mask, rng).astype(np.float32),
                long_fov_deg=float(np.degrees(2 * np.arctan(camera.tan_half))),
                fov_source="given",
                name=f"{asset.name}, {shape.name}, photo {k}",
                warnings=(),
            )
        )
    return Place(radiance=radiance, photos=tuple(photos), map_from_camera=np.array(turns))
