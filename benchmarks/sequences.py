"""Rendered sequences of one object: a still scene, a camera that goes round it, an emitter that jumps or swings.

Every frame is photographed as a camera does it: response curve, noise, 8 bits, JPEG; and its mask's edge
trembles as masks found anew in each frame do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import CameraCurve
from anyprobe.estimate.photo import Photo
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import blob, lathe, superquadric
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.camera import Shot, one_photo
from anyprobe_train.dataset.mask_errors import fray
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import direction_at, sky, soft_cap, studio

FPS = 24
SIZE = 160
FOV_DEG, MARGIN = 24.0, 1.25
OBJECT_MEAN = 0.3
"""Mean radiance of the object in the first frame; the exposure is then locked."""

NOISE, JPEG_QUALITY = 0.01, 90
EDGE_PX, EDGE_DEPTH = 1.5, 0.4
"""Of the mask's fraying, see dataset.mask_errors.fray: its edge moves by up to about a pixel."""

EMITTER_RADIUS, EMITTER_POWER = 0.25, 45.0
"""Radians; over a surround of mean luminance 1. Its irradiance is about three times the surround's."""

EMITTER_HEIGHT, EMITTER_LEFT, EMITTER_RIGHT = np.radians([45.0, -140.0, 140.0])
"""Elevation, and azimuths: 0 is what the first frame's camera looks at, so both are behind the camera."""

ORBIT_DEG_S, SWING_DEG_S = 30.0, 60.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """A surround, a shape and what it is made of. surround: [H, 2H, 3], world frame, mean luminance 1."""

    name: str
    surround: np.ndarray
    mesh: Mesh
    material: Material


@dataclass(frozen=True, kw_only=True, slots=True)
class Sequence:
    """yaw [radians] of the camera and azimuth of the emitter at time t [s]; jump_s: when the emitter jumps."""

    name: str
    seconds: float
    yaw: Callable[[float], float]
    emitter: Callable[[float], float]
    jump_s: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Taken:
    """One frame: the photo, and the true light [64, 128, 3] in its camera's frame and exposure units."""

    time_s: float
    photo: Photo
    truth: np.ndarray


def sequences(seconds: float) -> list[Sequence]:
    """Four of so many seconds, in one of which the emitter jumps after two thirds."""
    jump_s = round(seconds * 2 / 3 * FPS) / FPS
    orbit, swing = np.radians([ORBIT_DEG_S, SWING_DEG_S])
    return [
        Sequence(name="still", seconds=seconds, yaw=lambda t: 0.0, emitter=lambda t: EMITTER_LEFT),
        Sequence(name="camera turns", seconds=seconds, yaw=lambda t: orbit * t, emitter=lambda t: EMITTER_LEFT),
        Sequence(
            name="emitter jumps",
            seconds=seconds,
            yaw=lambda t: 0.0,
            emitter=lambda t: EMITTER_LEFT if t < jump_s - 1e-6 else EMITTER_RIGHT,
            jump_s=jump_s,
        ),
        Sequence(name="emitter swings", seconds=seconds, yaw=lambda t: 0.0, emitter=lambda t: EMITTER_LEFT - swing * t),
    ]


def scenes() -> list[Scene]:
    """A glossy vase in a room, a rough golden pebble in a studio, a matt block under a sky."""
    rng = np.random.default_rng
    glossy = Material(albedo=np.array([0.42, 0.36, 0.30]), f0=np.full(3, 0.045), alpha=0.15)
    gold = Material(albedo=np.zeros(3), f0=np.array([1.0, 0.77, 0.34]), alpha=0.3)
    matt = Material(albedo=np.array([0.5, 0.5, 0.55]), f0=np.full(3, 0.04), alpha=0.8)
    return [
        Scene(name="vase", surround=room(rng(17), 128), mesh=lathe(rng(0)), material=glossy),
        Scene(name="pebble", surround=studio(rng(3), 128), mesh=blob(rng(7)), material=gold),
        Scene(name="block", surround=sky(rng(5), 128), mesh=superquadric(rng(2)), material=matt),
    ]


def drawn_scene(seed: int) -> Scene:
    """One of any number: a room, studio or sky, a shape and a material."""
    surround, shape = ((room, studio, sky)[seed % 3], (lathe, blob, superquadric)[(seed // 3 + seed) % 3])
    albedo, f0, alpha = (
        ((0.42, 0.36, 0.30), (0.045, 0.045, 0.045), 0.15),
        ((0.0, 0.0, 0.0), (1.0, 0.77, 0.34), 0.3),
        ((0.5, 0.5, 0.55), (0.04, 0.04, 0.04), 0.8),
        ((0.6, 0.3, 0.2), (0.04, 0.04, 0.04), 0.45),
    )[np.random.default_rng(seed).integers(4)]
    return Scene(
        name=str(seed),
        surround=surround(np.random.default_rng(1000 + seed), 128),
        mesh=shape(np.random.default_rng(2000 + seed)),
        material=Material(albedo=np.array(albedo), f0=np.array(f0), alpha=alpha),
    )


def emitter_at(scene: Scene, azimuth: float) -> np.ndarray:
    """The surround with the emitter, [H, 2H, 3]."""
    d = pixel_directions(scene.surround.shape[0]).astype(np.float64)
    cap = soft_cap(d, direction_at(azimuth, EMITTER_HEIGHT), EMITTER_RADIUS)
    return (scene.surround + EMITTER_POWER * cap * np.array([1.1, 1.0, 0.8])).astype(np.float32)


def camera_pose(yaw: float) -> np.ndarray:
    """world_from_camera [3, 3] of a camera that goes round the object."""
    return world_from_camera(yaw, 0.25)


def film(scene: Scene, sequence: Sequence, seed: int = 0) -> Iterator[Taken]:
    """The sequence's frames in order; what does not change between two frames is rendered once."""
    rng = np.random.default_rng(seed)
    shot = Shot(
        metering=0.0,
        object_key=0.0,
        scene_key=0.0,
        white_balance=np.ones(3, np.float32),
        curve=CameraCurve(exponent=0.9, sigma=0.6),
        noise=NOISE,
        jpeg_quality=JPEG_QUALITY,
    )
    gain, drawn_at = None, None
    for index in range(round(sequence.seconds * FPS)):
        time_s = index / FPS
        at = sequence.yaw(time_s), sequence.emitter(time_s)
        if at != drawn_at:
            light, drawn_at = emitter_at(scene, at[1]), at
            camera = frame_object(scene.mesh, camera_pose(at[0]), FOV_DEG, margin=MARGIN, size=SIZE)
            drawn = draw_mesh(scene.mesh, camera, light, scene.material)
            mask = drawn[..., 3] > 0.5
            gain = gain or OBJECT_MEAN / float(luminance(drawn[mask][:, :3]).mean())
            truth = np.maximum(shrink(rotate(light, camera.world_from_camera.T), MAP_HEIGHT), 0.0) * gain
        mask = drawn[..., 3] > 0.5
        background = np.full((*mask.shape, 3), OBJECT_MEAN, np.float32)
        rgb = one_photo(shot, drawn[..., :3] * gain, mask, background, rng)
        frayed = fray(mask, EDGE_PX, EDGE_DEPTH, rng).astype(np.float32)
        photo = Photo(
            rgb=rgb.astype(np.float32) / 255,
            mask=frayed,
            long_fov_deg=float(np.degrees(2 * np.arctan(camera.tan_half))),
            fov_source="given",
            name=f"{scene.name} {sequence.name} {index}",
            warnings=(),
        )
        yield Taken(time_s=time_s, photo=photo, truth=truth)
