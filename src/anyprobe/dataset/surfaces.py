"""Many shapes seen from many sides, rasterised once: the geometry of the training pairs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.core.frames import normalize, rotation_x, rotation_y, world_from_camera
from anyprobe.dataset.catalog import ShapeAsset
from anyprobe.dataset.stock import PROCEDURAL_VERSION
from anyprobe.files.atomic import atomic_path
from anyprobe.render.mesh import Mesh, transformed, waved
from anyprobe.render.parts import part
from anyprobe.render.shapes import draw_shape, figure
from anyprobe.render.surface import frame_object, see

NUM_ELEVATIONS = 8
ELEVATION_SINES = np.linspace(-0.1, 0.95, NUM_ELEVATIONS + 1)
"""Borders of the elevation classes; uniform in the sine is uniform on the sphere."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceConfig:
    """views: per shape and elevation class; procedural: how many shapes of our own are added, and figures: how many
    made of several, each seen own_views times (None: views); parts: how many machined ones, each seen once, flat.

    stretch: standard deviation of the logarithm by which each view's shape is drawn out along three
    directions of its own; tilt_deg: of the angle by which it leans; bend, relief: by how much at most slow waves
    bend it and fast ones press a relief into it, as slopes below one in all. New shapes from old: there are few.
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


@dataclass(frozen=True, kw_only=True, slots=True)
class SurfaceSet:
    """normals [N, 3, S, S] float16 in the camera frame, zero outside the object;
    tan_half [N]; elevation [N] class index."""

    normals: np.ndarray
    tan_half: np.ndarray
    elevation: np.ndarray


def draw_elevation(rng: np.random.Generator, which: int) -> float:
    """An elevation [radians] inside a class."""
    return float(np.arcsin(rng.uniform(ELEVATION_SINES[which], ELEVATION_SINES[which + 1])))


def _varied(mesh: Mesh, config: SurfaceConfig, rng: np.random.Generator) -> Mesh:
    """The mesh bent and given a relief, drawn out along three random directions, then leaning some way."""
    if config.bend > 0 or config.relief > 0:
        slow, fast = _waves(rng, 3, (0.8, 3.0), config.bend), _waves(rng, 3, (5.0, 18.0), config.relief)
        mesh = waved(mesh, *(np.concatenate(pair) for pair in zip(slow, fast, strict=True)))
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    stretch = (axes * np.exp(rng.normal(0.0, config.stretch, 3))) @ axes.T
    toward = rng.uniform(0, 2 * np.pi)
    tilt = rotation_x(np.radians(rng.normal(0.0, config.tilt_deg)))
    lean = rotation_y(toward) @ tilt @ rotation_y(-toward)
    return transformed(mesh, lean @ stretch)


def _waves(
    rng: np.random.Generator, count: int, speed: tuple[float, float], most: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pushes, waves [count, 3] and phases [count] of waved, whose slopes sum to between none and `most`."""
    waves = normalize(rng.normal(size=(count, 3))) * np.exp(rng.uniform(*np.log(speed), size=(count, 1)))
    slopes = rng.dirichlet(np.ones(count)) * rng.uniform(0.0, most)
    pushes = normalize(rng.normal(size=(count, 3))) * (slopes / np.linalg.norm(waves, axis=1))[:, None]
    return pushes, waves, rng.uniform(0, 2 * np.pi, count)


def seen_part(number: int, config: SurfaceConfig) -> list[tuple[np.ndarray, float, int]]:
    """What is seen of machined part `number`, see _seen; it is not bent, and nothing is pressed into it."""
    rng = np.random.default_rng((config.seed, 1, number))
    return list(_seen(part(rng), 1, replace(config, bend=0.0, relief=0.0), rng))


def _seen(
    mesh: Mesh, views: int, config: SurfaceConfig, rng: np.random.Generator
) -> Iterator[tuple[np.ndarray, float, int]]:
    """Normals [3, S, S], tan_half and elevation class of a mesh's views, but for those that show next to nothing."""
    varied = any((config.stretch, config.tilt_deg, config.bend, config.relief))
    for which in range(NUM_ELEVATIONS):
        for _ in range(views):
            seen = _varied(mesh, config, rng) if varied else mesh
            rotation = world_from_camera(rng.uniform(0, 2 * np.pi), draw_elevation(rng, which))
            fov = np.exp(rng.uniform(np.log(6.0), np.log(50.0)))
            margin = rng.uniform(1.04, 1.2)
            surface = see(seen, frame_object(seen, rotation, fov, margin, config.size))
            if surface.mask.mean() < 0.04:
                continue
            picture = np.zeros((config.size, config.size, 3), np.float16)
            picture[surface.mask] = surface.normals
            yield picture.transpose(2, 0, 1), surface.tan_half, which


def build_surfaces(shapes: list[ShapeAsset], config: SurfaceConfig, cache: Path | None = None) -> SurfaceSet:
    """Rasterise shapes x elevation classes x views; kept in the folder cache when one is given."""
    ids = ",".join(shape.id for shape in shapes)
    key = hashlib.sha256(f"{PROCEDURAL_VERSION}|{config}|{ids}".encode()).hexdigest()[:16]
    path = None if cache is None else Path(cache) / f"surfaces-{key}.npz"
    if path is not None and path.is_file():
        with np.load(path) as stored:
            return SurfaceSet(**{name: stored[name] for name in ("normals", "tan_half", "elevation")})
    rng = np.random.default_rng(config.seed)
    meshes = [shape.mesh for shape in shapes] + [draw_shape(rng) for _ in range(config.procedural)]
    meshes += [figure(rng) for _ in range(config.figures)]
    seen = []
    for number, mesh in enumerate(meshes):
        own = number >= len(shapes) and config.own_views is not None
        seen += _seen(mesh, config.own_views if own else config.views, config, rng)
    for number in range(config.parts):
        seen += seen_part(number, config)
    normals, tan_half, elevation = zip(*seen, strict=True)
    result = SurfaceSet(
        normals=np.stack(normals), tan_half=np.array(tan_half, np.float32), elevation=np.array(elevation)
    )
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, open(temporary, "wb") as stream:
            np.savez(stream, normals=result.normals, tan_half=result.tan_half, elevation=result.elevation)
    return result
