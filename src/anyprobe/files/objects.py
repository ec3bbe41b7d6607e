"""Virtual objects: built-in ones by name, or mesh files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from numbers import Integral, Real
from pathlib import Path

import numpy as np

from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe.files.meshes import MESH_SUFFIXES, read_mesh
from anyprobe.render.mesh import Mesh, make_mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import Material, material_named

MOST_SIDE = 4096
"""Largest side [px] of a drawn picture."""


def _stored(name: str) -> Mesh:
    """Read an object of objects.npz, which anyprobe_train.dataset.random_shapes writes."""
    with np.load(Path(__file__).with_suffix(".npz")) as file:
        mesh = make_mesh(file[name], file[f"{name} faces"], name)
        normals = file.get(f"{name} normals")
    return mesh if normals is None else replace(mesh, normals=normals[mesh.faces])


OBJECTS: dict[str, Callable[[], Mesh]] = {
    "sphere": lambda: sphere(48),
    **{name: partial(_stored, name) for name in ("vase", "pebble", "block", "solid")},
}


def open_object(name: str) -> Mesh:
    """Return one of OBJECTS, or read a mesh file; +Y is up. InputError lists the names."""
    if name in OBJECTS:
        return OBJECTS[name]()
    if not Path(name).suffix:
        named = f"expected one of {', '.join(OBJECTS)} or a mesh file ({', '.join(MESH_SUFFIXES)})"
        raise InputError(f"{named}, got {name!r}{did_you_mean(name, OBJECTS)}", subject="object")
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

    core.response converts it to display values.

    Args:
        radiance: [H, 2H, 3].
        mesh: of render.shapes or render.mesh, one of OBJECTS, or a mesh file; +Y up, inside the unit sphere.
        material: of scatter.materials, or a name.
        size: side [px]. fov_deg: field of view, which the unit sphere fills.
        world_from_camera: [3, 3], the world being the map's frame; None: the camera looks along -Z as the photo's did.
    Raises:
        InputError: invalid size or field of view; see also open_object and material_named.
    """
    if not (isinstance(size, Integral) and 1 <= size <= MOST_SIDE):
        raise InputError(f"expected an integer number of pixels from 1 to {MOST_SIDE}, got {size}", subject="size")
    if not (isinstance(fov_deg, Real) and 0 < fov_deg < 180):
        raise InputError(f"expected more than 0 and less than 180 degrees, got {fov_deg}", subject="fov_deg")
    mesh = mesh if isinstance(mesh, Mesh) else open_object(str(mesh))
    material = material if isinstance(material, Material) else material_named(material)
    turn = np.eye(3) if world_from_camera is None else world_from_camera
    return draw_mesh(mesh, frame_object(mesh, turn, fov_deg, size=size), radiance, material)
