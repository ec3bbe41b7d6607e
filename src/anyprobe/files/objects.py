"""Virtual objects by name, made here, or from a mesh file."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Integral, Real
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError
from anyprobe.files.meshes import read_mesh
from anyprobe.render.mesh import Mesh, make_mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import blob, lathe, rounded_polyhedron, sphere, superquadric
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import Material, material_named

MOST_SIDE = 4096
"""Pixels along a side of a drawn picture."""
BASE = 0.08
"""Share of the vase's height that its rounded foot is cut off at, so that it stands."""


def _vase() -> Mesh:
    mesh = lathe(np.random.default_rng(0), rows=72)
    positions = mesh.positions.copy()
    low, high = positions[:, 1].min(), positions[:, 1].max()
    positions[:, 1] = np.maximum(positions[:, 1], low + BASE * (high - low))
    return make_mesh(positions, mesh.faces, "vase")


OBJECTS: dict[str, Callable[[], Mesh]] = {
    "sphere": lambda: sphere(48),
    "vase": _vase,
    "pebble": lambda: blob(np.random.default_rng(7), rows=56),
    "block": lambda: superquadric(np.random.default_rng(2), rows=56),
    "solid": lambda: rounded_polyhedron(np.random.default_rng(4), rows=64),
}


def open_object(name: str) -> Mesh:
    """One of OBJECTS, or a mesh file; +Y is up. InputError or InvalidMesh lists them."""
    if name in OBJECTS:
        return OBJECTS[name]()
    if not Path(name).suffix:
        raise InputError(
            f"expected one of {', '.join(OBJECTS)} or a mesh file (.glb, .obj, .ply), got {name!r}", subject="object"
        )
    return read_mesh(name)


def draw_under(
    radiance: np.ndarray,
    mesh: Mesh | str | Path,
    material: Material | str = "chrome",
    *,
    size: int = 256,
    fov_deg: float = 30.0,
    world_from_camera: np.ndarray | None = None,
) -> np.ndarray:
    """Draw a mesh lit by an environment map: [S, S, 4] linear radiance in the map's units, and coverage.

    core.response makes display values of it.

    Args:
        radiance: [H, 2H, 3].
        mesh: of render.shapes or render.mesh, one of OBJECTS, or a mesh file; +Y up, inside the unit sphere.
        material: of scatter.materials, or a name.
        size: pixels along a side. fov_deg: that the unit sphere fills.
        world_from_camera: [3, 3], the world being the map's frame; None: the camera looks along -Z as the photo's did.
    Raises:
        InputError: another size or field of view, or as of open_object and material_named.
    """
    if not (isinstance(size, Integral) and 1 <= size <= MOST_SIDE):
        raise InputError(f"expected a whole number of pixels from 1 to {MOST_SIDE}, got {size}", subject="size")
    if not (isinstance(fov_deg, Real) and 0 < fov_deg < 180):
        raise InputError(f"expected more than 0 and less than 180 degrees, got {fov_deg}", subject="fov_deg")
    mesh = mesh if isinstance(mesh, Mesh) else open_object(str(mesh))
    material = material if isinstance(material, Material) else material_named(material)
    turn = np.eye(3) if world_from_camera is None else world_from_camera
    return draw_mesh(mesh, frame_object(mesh, turn, fov_deg, size=size), radiance, material)
