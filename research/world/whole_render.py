"""Whole photos by Mitsuba: the phone's picture, the object's mask, and what a probe in its place sees without it."""

from __future__ import annotations

import gc
from dataclasses import dataclass

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import uv_to_direction
from anyprobe.light.environment import MAP_HEIGHT, rotate
from research.path_traced import NAME, _environment, _shape, open_mitsuba
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


def render_scene(scene: Scene, radiance: np.ndarray, paths: int = PATHS, map_paths: int = MAP_PATHS) -> Render:
    """Path trace a scene under a map [H, 2H, 3]."""
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
    picture, mask = _photograph(mi, tracer, whole, alone, hiding, scene, paths)
    made = Render(picture=picture, mask=mask, truth=_probe(mi, tracer, empty, scene, map_paths))
    del light, thing, fixed, alone, hiding, whole, empty, tracer
    gc.collect()  # numbers of objects are free again, so that the next scene finds its kernels compiled
    return made


def _photograph(mi, tracer, whole, alone, hiding, scene: Scene, paths: int):
    phone = scene.phone
    rows, columns = phone.height, phone.width
    y, x = (one.ravel() for one in np.mgrid[0:rows, 0:columns])
    total, covered = np.zeros((rows * columns, 3)), np.zeros(rows * columns)
    rng = np.random.default_rng(0)
    each = max(1, min(paths, AT_ONCE // (rows * columns)))
    side = int(np.ceil(np.sqrt(paths)))
    strata = rng.permutation(side * side)[:paths]
    for start in range(0, paths, each):
        some = strata[start : start + each, None]
        shift = rng.random((2, len(some), rows * columns), dtype=np.float32)
        across = x + (some % side + shift[0]) / side
        down = y + (some // side + shift[1]) / side
        direction = phone.rays(across.ravel(), down.ravel())
        rays = mitsuba_rays(mi, phone.position, direction)
        sampler = mi.load_dict({"type": "independent", "sample_count": 1})
        sampler.seed(1 + start, len(direction))
        color, _, _ = tracer.sample(whole, sampler, rays)
        total += np.nan_to_num(np.array(color).T).reshape(len(some), -1, 3).sum(axis=0)
        own = np.array(alone.ray_intersect_preliminary(rays).t)
        other = np.array(hiding.ray_intersect_preliminary(rays).t)  # of what may stand before the object
        covered += (np.isfinite(own) & (own < other)).reshape(len(some), -1).sum(axis=0)
    picture = (total / paths).reshape(rows, columns, 3).astype(np.float32)
    return picture, (covered / paths).reshape(rows, columns).astype(np.float32)


def mitsuba_rays(mi, origin: np.ndarray, direction: np.ndarray):
    """Convert world rays [N, 3] from one place or one each."""
    import drjit as dr

    origin = np.broadcast_to(origin, direction.shape)
    unit = dr.opaque(mi.Float, 1.0)  # products are aligned as Dr.Jit prefers, which every kernel depends on
    origins, directions = (unit * kind(*x.T.copy()) for kind, x in ((mi.Point3f, origin), (mi.Vector3f, direction)))
    dr.eval(origins, directions)
    return mi.RayDifferential3f(origins, directions)


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
    color, _, _ = tracer.sample(empty, sampler, mitsuba_rays(mi, scene.center, direction))
    values = np.nan_to_num(np.array(color).T).reshape(MAP_HEIGHT, side, 2 * MAP_HEIGHT, side, 3)
    weight = np.sin(np.pi * v).reshape(MAP_HEIGHT, side, 2 * MAP_HEIGHT, side, 1)
    return ((values * weight).sum(axis=(1, 3)) / weight.sum(axis=(1, 3))).astype(np.float32)


def _panel(mi, panel: Panel):
    """A rectangle with the material's own reflection and its picture, which is repeated mirrored."""
    bitmap = mi.Bitmap(np.ascontiguousarray(panel.cover.albedo, np.float32))
    albedo = {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "mirror"}
    bsdf = {"type": NAME, "albedo": albedo, "f0": [PANEL_F0] * 3, "alpha": panel.cover.alpha}
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    made = mi.Mesh("panel", 4, 2, has_vertex_texcoords=True, props=properties)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    positions = np.c_[corners, np.zeros(4), np.ones(4)] @ panel.world_from_panel.T
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = positions[:, :3].astype(np.float32).ravel()
    parameters["vertex_texcoords"] = ((corners + 1) * panel.half / panel.cover.side).astype(np.float32).ravel()
    parameters["faces"] = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    parameters.update()
    return made
