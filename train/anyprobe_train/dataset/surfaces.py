"""Many shapes seen from many sides, rasterised once: the geometry of training pairs."""

from __future__ import annotations

import hashlib
import signal
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from anyprobe.core.frames import normalize, rotation_x, rotation_y, world_from_camera
from anyprobe.files.atomic import atomic_path
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import frame_object, see
from anyprobe_train.dataset.asset_store import PROCEDURAL_VERSION
from anyprobe_train.dataset.catalog import ShapeAsset
from anyprobe_train.dataset.drawn_shapes import draw_shape, figure, part, transformed, waved
from anyprobe_train.dataset.occlusion import SIDE, hidden_cells
from anyprobe_train.dataset.processes import one_thread

NUM_ELEVATIONS = 8
ELEVATION_SINES = np.linspace(-0.1, 0.95, NUM_ELEVATIONS + 1)
"""Borders of the elevation classes in sine; uniform in the sine is uniform on the sphere."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceConfig:
    """Number and variation of rasterised shapes.

    views: per shape and elevation class; procedural: number of procedural shapes added, figures: number of those made
    of several pieces, each seen own_views times (None: views); parts: number of machined ones, each seen once, flat.

    New shapes are made from the few that there are. stretch: standard deviation of ln of the factors that stretch each
    view's shape along three random directions; tilt_deg: standard deviation of its tilt; bend, relief: largest slopes
    of the slow waves that bend it and of the fast ones that emboss it, below one in sum.
    shadows: whether to store the directions that each shape hides from itself (dataset.occlusion).
    """

    views: int = 3
    own_views: int | None = None
    procedural: int = 60
    figures: int = 0
    parts: int = 0
    stretch: float = 0.0
    tilt_deg: float = 0.0
    bend: float = 0.0
    relief: float = 0.0
    size: int = 128
    seed: int = 1
    shadows: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceSet:
    """Rasterised views of shapes.

    normals [N, 3, S, S] float16 in the camera frame, zero outside the object;
    tan_half [N]; elevation [N] class index; hidden [N, AZIMUTHS, SIDE, SIDE] of dataset.occlusion, or None.
    """

    normals: np.ndarray
    tan_half: np.ndarray
    elevation: np.ndarray
    hidden: np.ndarray | None = None


def draw_elevation(rng: np.random.Generator, elevation_class: int) -> float:
    """Draw an elevation [radians] inside a class."""
    return float(np.arcsin(rng.uniform(ELEVATION_SINES[elevation_class], ELEVATION_SINES[elevation_class + 1])))


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceView:
    """How a shape is looked at: world_from_camera [3, 3], elevation class, field of view and margin of frame_object.

    Before that, waves (pushes, waves, phases of drawn_shapes.waved) and a matrix [3, 3] make another shape of it.
    """

    world_from_camera: np.ndarray
    elevation: int
    fov_deg: float
    margin: float
    waves: tuple[np.ndarray, np.ndarray, np.ndarray] | None
    matrix: np.ndarray | None


_View = tuple[np.ndarray, float, int, np.ndarray]
"""Arrays of one view in the order of SurfaceSet; empty hidden cells unless they are requested."""


def draw_views(views: int, config: SurfaceConfig, rng: np.random.Generator) -> list[SurfaceView]:
    """Draw `views` views of each class, independently of the shape."""
    return [draw_view(which, config, rng) for which in range(NUM_ELEVATIONS) for _ in range(views)]


def draw_view(elevation_class: int, config: SurfaceConfig, rng: np.random.Generator) -> SurfaceView:
    """Draw a view of an elevation class, and what is made of the shape before."""
    waves = matrix = None
    if config.bend > 0 or config.relief > 0:
        slow, fast = _waves(rng, 3, (0.8, 3.0), config.bend), _waves(rng, 3, (5.0, 18.0), config.relief)
        pushes, lengths, phases = (np.concatenate(pair) for pair in zip(slow, fast, strict=True))
        waves = pushes, lengths, phases
    if any((config.stretch, config.tilt_deg, config.bend, config.relief)):
        matrix = _stretch_and_lean(config, rng)
    return SurfaceView(
        world_from_camera=world_from_camera(rng.uniform(0, 2 * np.pi), draw_elevation(rng, elevation_class)),
        elevation=elevation_class,
        fov_deg=np.exp(rng.uniform(np.log(6.0), np.log(50.0))),
        margin=rng.uniform(1.04, 1.2),
        waves=waves,
        matrix=matrix,
    )


def _stretch_and_lean(config: SurfaceConfig, rng: np.random.Generator) -> np.ndarray:
    """Draw a matrix that stretches along three random directions, then tilts in a random direction."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    stretch = (axes * np.exp(rng.normal(0.0, config.stretch, 3))) @ axes.T
    toward = rng.uniform(0, 2 * np.pi)
    tilt = rotation_x(np.radians(rng.normal(0.0, config.tilt_deg)))
    return rotation_y(toward) @ tilt @ rotation_y(-toward) @ stretch


def _waves(
    rng: np.random.Generator, count: int, frequency: tuple[float, float], max_slope: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw pushes, waves [count, 3] and phases [count] for `waved`, whose slopes sum to at most max_slope."""
    along = normalize(rng.normal(size=(count, 3)))
    waves = along * np.exp(rng.uniform(np.log(frequency[0]), np.log(frequency[1]), size=(count, 1)))
    slopes = rng.dirichlet(np.ones(count)) * rng.uniform(0.0, max_slope)
    pushes = normalize(rng.normal(size=(count, 3))) * (slopes / np.linalg.norm(waves, axis=1))[:, None]
    return pushes, waves, rng.uniform(0, 2 * np.pi, count)


def see_views(mesh: Mesh, views: list[SurfaceView], size: int, shadows: bool = False) -> list[_View]:
    """Rasterise the views of a mesh that show enough of it; shadows: with hidden cells."""
    result = []
    for view in views:
        seen = mesh if view.waves is None else waved(mesh, *view.waves)
        seen = seen if view.matrix is None else transformed(seen, view.matrix)
        surface = see(seen, frame_object(seen, view.world_from_camera, view.fov_deg, view.margin, size))
        if surface.mask.mean() < 0.04:
            continue
        picture = np.zeros((size, size, 3), np.float16)
        picture[surface.mask] = surface.normals
        hidden = hidden_cells(surface) if shadows else np.zeros((0, SIDE, SIDE), np.uint8)
        result.append((picture.transpose(2, 0, 1), surface.tan_half, view.elevation, hidden))
    return result


def drawn_part(number: int, config: SurfaceConfig) -> tuple[Mesh, list[SurfaceView]]:
    """Draw machined part `number` and its views; it is neither bent nor embossed."""
    rng = np.random.default_rng((config.seed, 1, number))
    return part(rng), draw_views(1, replace(config, bend=0.0, relief=0.0), rng)


def _shapes_and_views(shapes: list[ShapeAsset], config: SurfaceConfig) -> Iterator[tuple[Mesh, list[SurfaceView]]]:
    rng = np.random.default_rng(config.seed)
    meshes = [shape.mesh for shape in shapes] + [draw_shape(rng) for _ in range(config.procedural)]
    meshes += [figure(rng) for _ in range(config.figures)]
    for number, mesh in enumerate(meshes):
        own_views = config.own_views if number >= len(shapes) else None
        yield mesh, draw_views(config.views if own_views is None else own_views, config, rng)
    for number in range(config.parts):
        yield drawn_part(number, config)


def _see_all(
    jobs: Iterator[tuple[Mesh, list[SurfaceView]]], config: SurfaceConfig, workers: int
) -> Iterator[list[_View]]:
    """Yield see_views of each shape, in order, made by `workers` processes; 0: by this one."""
    see = partial(see_views, size=config.size, shadows=config.shadows)
    if workers == 0:
        for job in jobs:
            yield see(*job)
        return
    pending: deque = deque()
    spawn, quiet = get_context("spawn"), (signal.SIGINT, signal.SIG_IGN)
    with one_thread(), ProcessPoolExecutor(workers, spawn, signal.signal, quiet) as pool:
        try:
            for job in jobs:
                pending.append(pool.submit(see, *job))
                if len(pending) > 4 * workers:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)


def build_surfaces(
    shapes: list[ShapeAsset],
    config: SurfaceConfig,
    cache: Path | None = None,
    workers: int = 0,
    watch: Callable[[int, int], None] | None = None,
) -> SurfaceSet:
    """Rasterise shapes x elevation classes x views, cached in a folder if one is given.

    Args:
        workers: processes that draw, 0 for this one; what is drawn does not depend on it.
        watch: hears how many shapes of how many are drawn.
    """
    ids = ",".join(shape.id for shape in shapes)
    config_text = str(config).replace(", shadows=False", "")  # what is kept from before stays
    key = hashlib.sha256(f"{PROCEDURAL_VERSION}|{config_text}|{ids}".encode()).hexdigest()[:16]
    folder = None if cache is None else Path(cache) / f"surfaces-{key}"
    names = ARRAYS if config.shadows else ARRAYS[:-1]
    if folder is not None and all((folder / f"{name}.npy").is_file() for name in names):
        return _open_cached(folder, names)
    total = len(shapes) + config.procedural + config.figures + config.parts
    seen: list[_View] = []
    for done, shape_views in enumerate(_see_all(_shapes_and_views(shapes, config), config, workers), start=1):
        seen += shape_views
        if watch is not None:
            watch(done, total)
    normals, tan_half, elevation, hidden = zip(*seen, strict=True)
    result = SurfaceSet(
        normals=np.stack(normals),
        tan_half=np.array(tan_half, np.float32),
        elevation=np.array(elevation),
        hidden=np.stack(hidden) if config.shadows else None,
    )
    if folder is None:
        return result
    for name in names:
        with atomic_path(folder / f"{name}.npy") as temporary:
            np.save(temporary, getattr(result, name))
    return _open_cached(folder, names)


ARRAYS = ("normals", "tan_half", "elevation", "hidden")


def _open_cached(folder: Path, names: tuple[str, ...]) -> SurfaceSet:
    """Open the arrays of a folder; they stay on disk, so that all processes of a machine share them in memory."""
    return SurfaceSet(**{name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in names})
