"""Many shapes seen from many sides, rasterised once: the geometry of training pairs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.frames import world_from_camera
from anyprobe.files.atomic import atomic_path
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import frame_object, see
from anyprobe_train.dataset.asset_store import PROCEDURAL_VERSION
from anyprobe_train.dataset.catalog import ShapeAsset
from anyprobe_train.dataset.drawn_shapes import draw_shape, figure, part, transformed

NUM_ELEVATIONS = 8
ELEVATION_SINES = np.linspace(-0.1, 0.95, NUM_ELEVATIONS + 1)
"""Borders of the elevation classes in sine; uniform in the sine is uniform on the sphere."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceConfig:
    """Number and variation of rasterised shapes.

    views: per shape and elevation class; procedural: number of procedural shapes added, figures: number of those made
    of several pieces; parts: number of machined ones, each seen once. stretch: standard deviation of ln of the factors
    that stretch each view's shape along three random directions.
    """

    views: int = 3
    procedural: int = 60
    figures: int = 0
    parts: int = 0
    stretch: float = 0.0
    size: int = 128
    seed: int = 1


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceSet:
    """Rasterised views of shapes.

    normals [N, 3, S, S] float16 in the camera frame, zero outside the object;
    tan_half [N]; elevation [N] class index.
    """

    normals: np.ndarray
    tan_half: np.ndarray
    elevation: np.ndarray


def draw_elevation(rng: np.random.Generator, elevation_class: int) -> float:
    """Draw an elevation [radians] inside a class."""
    return float(np.arcsin(rng.uniform(ELEVATION_SINES[elevation_class], ELEVATION_SINES[elevation_class + 1])))


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceView:
    """How a shape is looked at: world_from_camera [3, 3], elevation class, field of view and margin of frame_object.

    Before that, a matrix [3, 3] makes another shape of it.
    """

    world_from_camera: np.ndarray
    elevation: int
    fov_deg: float
    margin: float
    matrix: np.ndarray | None


_View = tuple[np.ndarray, float, int]
"""Arrays of one view in the order of SurfaceSet."""


def draw_views(views: int, config: SurfaceConfig, rng: np.random.Generator) -> list[SurfaceView]:
    """Draw `views` views of each class, independently of the shape."""
    return [draw_view(which, config, rng) for which in range(NUM_ELEVATIONS) for _ in range(views)]


def draw_view(elevation_class: int, config: SurfaceConfig, rng: np.random.Generator) -> SurfaceView:
    """Draw a view of an elevation class, and what is made of the shape before."""
    matrix = stretched(config.stretch, rng) if config.stretch else None
    return SurfaceView(
        world_from_camera=world_from_camera(rng.uniform(0, 2 * np.pi), draw_elevation(rng, elevation_class)),
        elevation=elevation_class,
        fov_deg=np.exp(rng.uniform(np.log(6.0), np.log(50.0))),
        margin=rng.uniform(1.04, 1.2),
        matrix=matrix,
    )


def stretched(spread: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a matrix that stretches along three random directions; spread: standard deviation of ln of its factors."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return (axes * np.exp(rng.normal(0.0, spread, 3))) @ axes.T


def see_views(mesh: Mesh, views: list[SurfaceView], size: int) -> list[_View]:
    """Rasterise the views of a mesh that show enough of it."""
    result = []
    for view in views:
        seen = mesh if view.matrix is None else transformed(mesh, view.matrix)
        surface = see(seen, frame_object(seen, view.world_from_camera, view.fov_deg, view.margin, size))
        if surface.mask.mean() < 0.04:
            continue
        picture = np.zeros((size, size, 3), np.float16)
        picture[surface.mask] = surface.normals
        result.append((picture.transpose(2, 0, 1), surface.tan_half, view.elevation))
    return result


def _shapes_and_views(shapes: list[ShapeAsset], config: SurfaceConfig) -> Iterator[tuple[Mesh, list[SurfaceView]]]:
    rng = np.random.default_rng(config.seed)
    meshes = [shape.mesh for shape in shapes] + [draw_shape(rng) for _ in range(config.procedural)]
    meshes += [figure(rng) for _ in range(config.figures)]
    for mesh in meshes:
        yield mesh, draw_views(config.views, config, rng)
    for number in range(config.parts):
        own = np.random.default_rng((config.seed, 1, number))
        yield part(own), draw_views(1, config, own)


def build_surfaces(shapes: list[ShapeAsset], config: SurfaceConfig, cache: Path | None = None) -> SurfaceSet:
    """Rasterise shapes x elevation classes x views, cached in a folder if one is given."""
    ids = ",".join(shape.id for shape in shapes)
    key = hashlib.sha256(f"{PROCEDURAL_VERSION}|{config}|{ids}".encode()).hexdigest()[:16]
    folder = None if cache is None else Path(cache) / f"surfaces-{key}"
    if folder is not None and all((folder / f"{name}.npy").is_file() for name in ARRAYS):
        return _open_cached(folder)
    seen: list[_View] = []
    for mesh, views in _shapes_and_views(shapes, config):
        seen += see_views(mesh, views, config.size)
    normals, tan_half, elevation = zip(*seen, strict=True)
    result = SurfaceSet(
        normals=np.stack(normals), tan_half=np.array(tan_half, np.float32), elevation=np.array(elevation)
    )
    if folder is None:
        return result
    for name in ARRAYS:
        with atomic_path(folder / f"{name}.npy") as temporary:
            np.save(temporary, getattr(result, name))
    return _open_cached(folder)


ARRAYS = ("normals", "tan_half", "elevation")


def _open_cached(folder: Path) -> SurfaceSet:
    """Open the arrays of a folder; they stay on disk, so that all processes of a machine share them in memory."""
    return SurfaceSet(**{name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in ARRAYS})
