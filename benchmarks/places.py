"""One object in one light, photographed from several sides with exposure and white balance locked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.frames import normalize, rotation_y, world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import response
from anyprobe.estimate.photo import Photo
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.render.surface import frame_object, see
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.camera import Shot, draw_shot, exposure, one_photo
from anyprobe_train.dataset.distributions import draw_alpha, draw_material
from anyprobe_train.dataset.mask_errors import disturb_mask
from anyprobe_train.dataset.pair import shade_surface

PHONE_FOV_DEG, PHONE_ASPECT = 65.0, 0.75
"""The photos that show more than the object: its middle is theirs."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Place:
    """radiance [64, 128, 3]: the light in the first camera's frame and exposure units; photos, and of each camera
    map_from_camera [N, 3, 3]."""

    radiance: np.ndarray
    photos: tuple[Photo, ...]
    map_from_camera: np.ndarray


def draw_place(
    store: AssetStore, rng: np.random.Generator, count: int, arc_deg: float = 360.0, room: float | None = None
) -> Place:
    """A random map, shape, material and camera, as the world gives them.

    Args:
        count: photos; the camera goes round the object, evenly.
        arc_deg: by so much from the first photo to the last, all round at 360, where the last is not the first again.
        room: the camera's distance from the object over that of all that lights it, behind which the photos then show
            it: walls that are not infinitely far look displaced. None: black behind the object.
    """
    maps, shapes = list(store.maps.values()), list(store.shapes.values())
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
        shading = shade_surface(store.pyramid(asset.id), surface, turns[-1], material.alpha)
        reflected = shading.radiance(material)
        if radiance is None:
            light = np.maximum(shrink(rotate(asset.radiance, turns[0].T), MAP_HEIGHT), 0.0)
            scene = float(np.exp(np.log(np.maximum(luminance(light), 1e-4)).mean()))
            gain = exposure(shot, float(luminance(reflected).mean()), scene)
            radiance = light * np.asarray(gain * shot.white_balance, np.float32)
        picture = np.zeros((*surface.mask.shape, 3), np.float32)
        picture[surface.mask] = reflected * gain
        display = one_photo(shot, picture, surface.mask, None, rng)
        mask, tan_half = disturb_mask(surface.mask, rng), camera.tan_half
        if room is not None:
            rays = _phone_rays(display.shape[0], tan_half)
            behind = _photo_of_room(asset.radiance * gain, rays @ turns[-1].T, turns[-1] @ [0, 0, room], shot, rng)
            display, mask = (
                _in_the_middle(display, surface.mask, behind),
                _in_the_middle(mask, mask, rays[..., 0] > 2),
            )
            tan_half = np.tan(np.radians(PHONE_FOV_DEG) / 2)
        photos.append(
            Photo(
                rgb=display.astype(np.float32) / 255,
                mask=mask.astype(np.float32),
                long_fov_deg=float(np.degrees(2 * np.arctan(tan_half))),
                fov_source="given",
                name=f"{asset.name}, {shape.name}, photo {k}",
                warnings=(),
            )
        )
    return Place(radiance=radiance, photos=tuple(photos), map_from_camera=np.array(turns))


def _phone_rays(size: int, tan_half: float) -> np.ndarray:
    """[H, W, 3] camera frame, of a phone's photo whose middle size x size pixels take in tan_half to either side."""
    step = 2 * tan_half / size
    half = np.tan(np.radians(PHONE_FOV_DEG) / 2)
    width, height = (max(size, 2 * round(side * half / step)) for side in (1.0, PHONE_ASPECT))
    x, y = (np.arange(width) + 0.5 - width / 2) * step, (height / 2 - np.arange(height) - 0.5) * step
    return normalize(np.stack([*np.meshgrid(x, y), np.full((height, width), -1.0)], axis=-1))


def _photo_of_room(
    radiance: np.ndarray, rays: np.ndarray, eye: np.ndarray, shot: Shot, rng: np.random.Generator
) -> np.ndarray:
    """A map as a unit sphere around the object, seen from a point [3] in it: uint8."""
    along = rays @ eye
    away = np.sqrt(along**2 + 1 - eye @ eye) - along
    seen = bilinear(radiance, direction_to_uv(eye + away[..., None] * rays).astype(np.float32))
    display = response(seen * shot.white_balance, shot.curve)
    return to_bytes(display + rng.standard_normal(display.shape, np.float32) * shot.noise)


def _in_the_middle(small: np.ndarray, mask: np.ndarray, large: np.ndarray) -> np.ndarray:
    """A large picture with what a mask marks of a small one in its middle."""
    whole, size = large.copy(), small.shape[0]
    top, left = (large.shape[0] - size) // 2, (large.shape[1] - size) // 2
    part = whole[top : top + size, left : left + size]
    part[mask] = small[mask]
    return whole
