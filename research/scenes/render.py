"""Layouts rendered by Mitsuba: fine where the object is, coarser around it, and what a probe in its place sees."""

from __future__ import annotations

import gc
from dataclasses import dataclass

import numpy as np
from PIL import Image

from anyprobe.core.latlong import bilinear, direction_to_uv, uv_to_direction
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.render.shapes import sphere
from research.path_traced import NAME, _environment, _shape, open_mitsuba
from research.scenes.layouts import Lamp, Layout
from research.world.whole_render import Render, mitsuba_rays
from research.world.whole_scenes import Panel

BATCH = 1 << 16
"""Rays in a wavefront, always: kernels are compiled for its size."""
FAR_PX, NEAR_PX = 4, 2
"""Sides [px] of the blocks that are traced far from the object and near it; the object's own are single pixels."""
FAR_PATHS, NEAR_PATHS, FINE_PATHS, PROBE_PATHS = 2, 3, 4, 4
"""Paths through one of these, and through a pixel of the probe's map."""
OBJECT_MARGIN, NEAR_MARGIN = 1.16, 2.5
"""Sides of the windows over the longer side of the object's box."""
SEAM_BLOCKS = 4
"""Over which a finer layer takes the place of a coarser one."""
MAX_DEPTH = 3
MOST_RATIO = 1.5
"""Of a lit ground with the object over the same without: reflections may brighten it."""
PANEL_F0 = 0.04


@dataclass(frozen=True, kw_only=True, slots=True)
class _Layer:
    """Blocks of step pixels over x0, y0, x1, y1 of the picture; paths through each."""

    step: int
    paths: int
    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def sides(self) -> tuple[int, int]:
        """Columns and rows of its blocks."""
        return -(-(self.x1 - self.x0) // self.step), -(-(self.y1 - self.y0) // self.step)


def render_layout(layout: Layout, quality: int = 1) -> Render:
    """Path trace a layout; quality multiplies the paths."""
    mi = open_mitsuba()
    light = mi.load_dict(_environment(mi, layout.light))
    f0 = 0.0 if layout.on_map else PANEL_F0
    fixed = {f"panel{k}": _panel(mi, panel, f0) for k, panel in enumerate(layout.panels)}
    fixed |= {f"other{k}": _shape(mi, one.mesh, one.material) for k, one in enumerate(layout.others)}
    thing = _shape(mi, layout.thing.mesh, layout.thing.material)
    lamps = {f"lamp{k}": _ball(mi, lamp) for k, lamp in enumerate(layout.lamps)}
    alone = mi.load_dict({"type": "scene", "thing": thing})
    whole = mi.load_dict({"type": "scene", "light": light, "thing": thing, **fixed, **lamps})
    tracer = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH})
    hiding = None if layout.on_map or not fixed else mi.load_dict({"type": "scene", **fixed})
    picture, mask = _picture(mi, tracer, whole, alone, hiding, layout, quality)
    del whole
    if layout.on_map:
        truth = reduced(rotate(layout.light, layout.phone.world_from_camera.T), MAP_HEIGHT)
    else:
        empty = mi.load_dict({"type": "scene", "light": light, **fixed, **lamps})
        truth = _probe(mi, tracer, empty, layout, PROBE_PATHS * quality)
        del empty
    del light, thing, fixed, alone, hiding, tracer, lamps
    gc.collect()  # numbers of objects are free again, so that the next scene finds its kernels compiled
    return Render(picture=picture, mask=mask, truth=np.maximum(truth, 0.0).astype(np.float32))


def _picture(mi, tracer, whole, alone, hiding, layout: Layout, quality: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the picture [H, W, 3] and the mask [H, W]: three layers, each finer and smaller than the one before."""
    phone = layout.phone
    layers = _layers(layout, quality)
    rng = np.random.default_rng(0)
    points = [_points(layer, rng) for layer in layers]
    direction = phone.rays(*np.concatenate(points, axis=1))
    color, own, other = _traced(mi, tracer, whole, alone, hiding, phone.position, direction)
    visible = np.isfinite(own) & (own < other)
    picture = np.zeros((phone.height, phone.width, 3), np.float32)
    mask = np.zeros((phone.height, phone.width), np.float32)
    if layout.on_map:
        x, y = np.meshgrid(np.arange(phone.width) + 0.5, np.arange(phone.height) + 0.5)
        picture[:] = _seen_map(layout, phone.rays(x, y))
    start = 0
    for layer, some in zip(layers, points, strict=True):
        part = slice(start, start + some.shape[1])
        start = part.stop
        values, covered = _blocks(layout, layer, direction[part], color[part], visible[part])
        rows, columns = layer.y1 - layer.y0, layer.x1 - layer.x0
        if layer.step > 1:
            values, covered = _enlarged(values, layer), covered.repeat(layer.step, 0).repeat(layer.step, 1)
        share = _share(layer, rows, columns, picture.shape)
        window = slice(layer.y0, layer.y1), slice(layer.x0, layer.x1)
        picture[window] += share * (values[:rows, :columns] - picture[window])
        mask[window] = covered[:rows, :columns]
    return picture, mask


def _layers(layout: Layout, quality: int) -> list[_Layer]:
    phone = layout.phone
    box = phone.pixels(layout.thing.mesh.positions)
    low, high = box.min(axis=0), box.max(axis=0)
    middle, side = (low + high) / 2, float((high - low).max())

    def window(step: int, paths: int, margin: float) -> _Layer:
        first = [max(0, int((c - margin * side / 2) // step) * step) for c in middle]
        sizes = phone.width, phone.height
        last = [min(n, -int(-(c + margin * side / 2) // step) * step) for c, n in zip(middle, sizes, strict=True)]
        return _Layer(step=step, paths=paths * quality, x0=first[0], y0=first[1], x1=last[0], y1=last[1])

    far = _Layer(step=FAR_PX, paths=FAR_PATHS * quality, x0=0, y0=0, x1=phone.width, y1=phone.height)
    near, fine = window(NEAR_PX, NEAR_PATHS, NEAR_MARGIN), window(1, FINE_PATHS, OBJECT_MARGIN)
    return [near, fine] if layout.on_map else [far, near, fine]  # beyond the shadow it is the map


def _points(layer: _Layer, rng: np.random.Generator) -> np.ndarray:
    """Return points of the picture x, y [2, paths * blocks]: stratified in each block."""
    columns, rows = layer.sides
    side = int(np.ceil(np.sqrt(layer.paths)))
    strata = rng.permutation(side * side)[: layer.paths, None]
    y, x = (one.ravel() for one in np.mgrid[0:rows, 0:columns])
    shift = rng.random((2, layer.paths, rows * columns), dtype=np.float32)
    across = layer.x0 + layer.step * (x + (strata % side + shift[0]) / side)
    down = layer.y0 + layer.step * (y + (strata // side + shift[1]) / side)
    return np.stack([across.ravel(), down.ravel()])


def _traced(mi, tracer, whole, alone, hiding, eye: np.ndarray, direction: np.ndarray):
    """Return radiance [N, 3] along rays, and the distances [N] of the object and of what may hide it."""
    import drjit as dr

    count = len(direction)
    color, own, other = np.zeros((count, 3), np.float32), np.full(count, np.inf), np.full(count, np.inf)
    for start in range(0, count, BATCH):
        part = direction[start : start + BATCH]
        padded = np.concatenate([part, np.broadcast_to(part[:1], (BATCH - len(part), 3))])
        rays = mitsuba_rays(mi, eye, padded)
        if alone is not None:
            own[start : start + BATCH] = np.array(alone.ray_intersect_preliminary(rays).t)[: len(part)]
        if hiding is not None:
            other[start : start + BATCH] = np.array(hiding.ray_intersect_preliminary(rays).t)[: len(part)]
        sampler = mi.load_dict({"type": "independent", "sample_count": 1})
        sampler.seed(dr.opaque(mi.UInt32, 1 + start // BATCH), BATCH)
        found, _, _ = tracer.sample(whole, sampler, rays)
        color[start : start + BATCH] = np.nan_to_num(np.array(found).T)[: len(part)]
    return color, own, other


def _blocks(layout: Layout, layer: _Layer, direction, color, visible) -> tuple[np.ndarray, np.ndarray]:
    """Return radiance [h, w, 3] and the object's share [h, w] of a layer's blocks."""
    columns, rows = layer.sides

    def mean(values: np.ndarray) -> np.ndarray:
        return values.reshape(layer.paths, rows, columns, -1).mean(axis=0)

    covered = mean(visible[:, None].astype(np.float32))
    traced = _denoised(mean(color))
    if not layout.on_map:
        return traced, covered[..., 0]
    expected, fade, on = _unshadowed(layout, direction)
    free = on & ~visible
    ground, without = traced * (1 - covered), mean(expected * free[:, None])
    ratio = _smooth(ground) / np.maximum(_smooth(without), 1e-6)
    change = 1.0 + mean((fade * free)[:, None]) * (np.clip(ratio, 0.0, MOST_RATIO) - 1.0)
    return covered * traced + mean(_seen_map(layout, direction) * ~visible[:, None]) * change, covered[..., 0]


def _unshadowed(layout: Layout, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what ground without the object sends along rays [N, 3], how much of it is meant [N], and where it is."""
    panel, eye = layout.panels[0], layout.phone.position
    distance = eye[1] / np.maximum(-direction[:, 1], 1e-6)
    half = panel.half[0]
    x, z = ((eye[axis] + distance * direction[:, axis]) / half for axis in (0, 2))
    far = np.maximum(np.abs(x), np.abs(z))
    on = (direction[:, 1] < -1e-6) & (far < 1.0)
    size = len(panel.cover.albedo)
    row, column = (np.clip((one + 1) / 2 * size, 0, size - 1).astype(int) for one in (z, x))
    fade = np.clip((1.0 - far) / 0.25, 0.0, 1.0)  # no seam at its border
    return panel.cover.albedo[row, column] * layout.ground_radiance, fade * on, on


def _share(layer: _Layer, rows: int, columns: int, shape: tuple[int, ...]) -> np.ndarray:
    """Return the share of a layer that is taken [rows, columns, 1]: less towards its borders within the picture."""
    sides = []
    for count, low, high, whole in ((rows, layer.y0, layer.y1, shape[0]), (columns, layer.x0, layer.x1, shape[1])):
        x = np.arange(count) + 0.5
        far = np.minimum(x if low > 0 else np.full(count, np.inf), count - x if high < whole else np.inf)
        sides.append(np.clip(far / (SEAM_BLOCKS * layer.step), 0.0, 1.0))
    return (sides[0][:, None] * sides[1])[..., None].astype(np.float32)


def _smooth(values: np.ndarray) -> np.ndarray:
    """Return means over 3 x 3 blocks of [h, w, 3]."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]) / 9.0


def _seen_map(layout: Layout, direction: np.ndarray) -> np.ndarray:
    return bilinear(layout.light, direction_to_uv(direction).astype(np.float32))


def _enlarged(values: np.ndarray, layer: _Layer) -> np.ndarray:
    """Return [h, w, 3] at the picture's pixels, between the blocks' middles."""
    columns, rows = layer.sides
    size = columns * layer.step, rows * layer.step
    planes = (np.ascontiguousarray(values[..., k], np.float32) for k in range(3))
    return np.dstack([np.asarray(Image.fromarray(one).resize(size, Image.Resampling.BILINEAR)) for one in planes])


def _denoised(values: np.ndarray) -> np.ndarray:
    """Return radiance [h, w, 3] without the noise of few paths, which no camera makes (Open Image Denoise)."""
    import mitsuba_oidn

    values = np.ascontiguousarray(values, np.float32)
    return np.maximum(mitsuba_oidn.denoise(values, hdr=True, quality=mitsuba_oidn.Quality.Fast), 0.0)


def _probe(mi, tracer, empty, layout: Layout, paths: int) -> np.ndarray:
    """Return [64, 128, 3] in the camera's frame."""
    side, rng = int(np.sqrt(paths)), np.random.default_rng(1)
    rows, columns = MAP_HEIGHT * side, 2 * MAP_HEIGHT * side
    v = (np.arange(rows)[:, None] + rng.random((rows, columns))) / rows
    u = (np.arange(columns)[None] + rng.random((rows, columns))) / columns
    direction = uv_to_direction(np.stack([u, v], axis=-1)).reshape(-1, 3) @ layout.phone.world_from_camera.T
    color, distance, _ = _traced(mi, tracer, empty, empty, None, layout.center, direction)
    hit = np.isfinite(distance).reshape(rows, columns, 1)

    def mean(one: np.ndarray) -> np.ndarray:
        return one.reshape(MAP_HEIGHT, side, 2 * MAP_HEIGHT, side, -1).mean(axis=(1, 3))

    # what nothing hides is the light itself, exactly: a lamp of one pixel is not missed by few paths
    free = reduced(rotate(layout.light, layout.phone.world_from_camera.T), MAP_HEIGHT)
    share, traced = mean(hit.astype(np.float32)), mean(color.reshape(rows, columns, 3) * hit)
    wide = np.concatenate([traced[:, -8:], traced, traced[:, :8]], axis=1)
    return _denoised(wide)[:, 8:-8] + free * (1 - share)


def _panel(mi, panel: Panel, f0: float):
    """Return a rectangle with the material's own reflection and its picture, which is repeated mirrored."""
    bitmap = mi.Bitmap(np.ascontiguousarray(panel.cover.albedo, np.float32))
    albedo = {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "mirror"}
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": NAME, "albedo": albedo, "f0": [f0] * 3, "alpha": panel.cover.alpha})
    made = mi.Mesh("panel", 4, 2, has_vertex_texcoords=True, props=properties)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    positions = np.c_[corners, np.zeros(4), np.ones(4)] @ panel.world_from_panel.T
    texture = (corners * [1, -1] + 1) * panel.half / panel.cover.side
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = positions[:, :3].astype(np.float32).ravel()
    parameters["vertex_texcoords"] = texture.astype(np.float32).ravel()
    parameters["faces"] = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    parameters.update()
    return made


def _ball(mi, lamp: Lamp):
    """Return a glowing ball, of triangles, so that it needs no kernels of its own."""
    properties = mi.Properties()
    radiance = {"type": "rgb", "value": [float(c) for c in lamp.radiance]}
    properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    ball = sphere(10)
    made = mi.Mesh("lamp", len(ball.positions), len(ball.faces), props=properties)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = (ball.positions * lamp.radius + lamp.center).astype(np.float32).ravel()
    parameters["faces"] = ball.faces.astype(np.uint32).ravel()
    parameters.update()
    return made
