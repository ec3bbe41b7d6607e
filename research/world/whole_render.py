"""Whole photos by Mitsuba: the phone's picture, the object's mask, and what a probe in its place sees without it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import uv_to_direction
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.relight.path_traced import NAME, _environment, _mi_rays, _shape, open_mitsuba
from research.world.whole_scenes import Panel, Scene

PATHS = 24
"""Through a pixel of the photo; the noise that is left is a camera's in a dim room."""
MAP_PATHS = 64
"""Through a pixel of the probe's map, evenly spread."""
MAX_DEPTH = 4
AT_ONCE = 1 << 20
PANEL_F0 = 0.04


@dataclass(frozen=True, kw_only=True, slots=True)
class Render:
    """Linear, in the map's units.

    picture: [H, W, 3]. mask: [H, W] share of the pixel that shows the object. truth: [64, 128, 3] what a probe in the
    object's centre sees with the object away, in the camera's frame.
    """

    picture: np.ndarray
    mask: np.ndarray
    truth: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """A square part of the photo's plane, which may reach over its border: center x, y and side [px of the photo]."""

    center: tuple[float, float]
    side: float
    size: int


def render_scene(
    scene: Scene, radiance: np.ndarray, paths: int = PATHS, map_paths: int = MAP_PATHS, window: Window | None = None
) -> Render:
    """Path trace a scene under a map [H, 2H, 3].

    Args:
        window: of which the picture is, [size, size]; None for the whole photo.
    """
    mi = open_mitsuba()
    surroundings = rotate(radiance, rotation_y(scene.map_yaw))
    fixed = {f"panel{k}": _panel(mi, panel) for k, panel in enumerate(scene.panels)}
    fixed |= {f"other{k}": _shape(mi, one.mesh, one.material) for k, one in enumerate(scene.others)}
    thing = _shape(mi, scene.thing.mesh, scene.thing.material)
    light = _environment(mi, surroundings)
    alone = mi.load_dict({"type": "scene", "thing": thing})
    hiding = mi.load_dict({"type": "scene", **fixed})
    whole = mi.load_dict({"type": "scene", "light": light, "thing": thing, **fixed})
    empty = mi.load_dict({"type": "scene", "light": light, **fixed})
    tracer = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH})
    picture, mask = _photograph(mi, tracer, whole, alone, hiding, scene, paths, window)
    return Render(picture=picture, mask=mask, truth=_probe(mi, tracer, empty, scene, map_paths))


def _photograph(mi, tracer, whole, alone, hiding, scene: Scene, paths: int, window: Window | None):
    phone = scene.phone
    if window is None:
        rows, columns, step, corner = phone.height, phone.width, 1.0, (0.0, 0.0)
    else:
        rows = columns = window.size
        step = window.side / window.size
        corner = window.center[0] - window.side / 2, window.center[1] - window.side / 2
    y, x = (one.ravel() for one in np.mgrid[0:rows, 0:columns])
    total, covered = np.zeros((rows * columns, 3)), np.zeros(rows * columns)
    rng = np.random.default_rng(0)
    each = max(1, min(paths, AT_ONCE // (rows * columns)))
    side = int(np.ceil(np.sqrt(paths)))
    strata = rng.permutation(side * side)[:paths]
    for start in range(0, paths, each):
        some = strata[start : start + each, None]
        shift = rng.random((2, len(some), rows * columns), dtype=np.float32)
        across = corner[0] + step * (x + (some % side + shift[0]) / side)
        down = corner[1] + step * (y + (some // side + shift[1]) / side)
        direction = phone.rays(across.ravel(), down.ravel())
        rays = _mi_rays(mi, phone.position, direction)
        sampler = mi.load_dict({"type": "independent", "sample_count": 1})
        sampler.seed(1 + start, len(direction))
        color, _, _ = tracer.sample(whole, sampler, rays)
        total += np.nan_to_num(np.array(color).T).reshape(len(some), -1, 3).sum(axis=0)
        own = np.array(alone.ray_intersect_preliminary(rays).t)
        other = np.array(hiding.ray_intersect_preliminary(rays).t)  # of what may stand before the object
        covered += (np.isfinite(own) & (own < other)).reshape(len(some), -1).sum(axis=0)
    picture = (total / paths).reshape(rows, columns, 3).astype(np.float32)
    return picture, (covered / paths).reshape(rows, columns).astype(np.float32)


def _probe(mi, tracer, empty, scene: Scene, paths: int) -> np.ndarray:
    """[64, 128, 3] in the camera's frame."""
    side = int(np.sqrt(paths))
    rng = np.random.default_rng(1)
    rows, columns = MAP_HEIGHT * side, 2 * MAP_HEIGHT * side
    v = (np.arange(rows)[:, None] + rng.random((rows, columns))) / rows
    u = (np.arange(columns)[None] + rng.random((rows, columns))) / columns
    direction = uv_to_direction(np.stack([u, v], axis=-1)).reshape(-1, 3) @ scene.phone.world_from_camera.T
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    sampler.seed(0, len(direction))
    color, _, _ = tracer.sample(empty, sampler, _mi_rays(mi, scene.center, direction))
    values = np.nan_to_num(np.array(color).T).reshape(MAP_HEIGHT, side, 2 * MAP_HEIGHT, side, 3)
    weight = np.sin(np.pi * v).reshape(MAP_HEIGHT, side, 2 * MAP_HEIGHT, side, 1)
    return ((values * weight).sum(axis=(1, 3)) / weight.sum(axis=(1, 3))).astype(np.float32)


def _panel(mi, panel: Panel) -> dict:
    """A rectangle with the material's own reflection and its picture, which is repeated mirrored."""
    bitmap = mi.Bitmap(np.ascontiguousarray(panel.cover.albedo, np.float32))
    scale = [2 * half / panel.cover.side for half in panel.half]
    albedo = {
        "type": "bitmap",
        "bitmap": bitmap,
        "raw": True,
        "wrap_mode": "mirror",
        "to_uv": mi.ScalarTransform3f().scale(mi.ScalarPoint2f(*scale)),
    }
    f0 = [PANEL_F0] * 3
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f(panel.world_from_panel),
        "bsdf": {"type": NAME, "albedo": albedo, "f0": f0, "alpha": panel.cover.alpha},
    }
