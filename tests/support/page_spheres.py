"""Spheres as the package's renderer draws them, to hold a browser's pixels against."""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import normalize
from anyprobe.core.response import response
from anyprobe.files.objects import open_object
from anyprobe.relight.ground_view import View
from anyprobe.relight.insert import window_of
from anyprobe.relight.placement import Placement
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.scatter.materials import MATERIALS

SPHERES = ("chrome", "gold", "matte")
MOST_OFF = 0.03
"""Median difference, of white; at the rim of a small source, which three.js spreads wider than a lobe is, few pixels
differ more."""


def typical_difference(page: np.ndarray, package: np.ndarray) -> float:
    """Of colours, of white, over the pixels [H, W, 4] that both cover wholly."""
    both = (page[..., 3] == 1) & (package[..., 3] == 1)
    return float(np.median(np.abs(page[both] - package[both])[:, :3]))


def drawn_by_package(width: int, height: int, pose: dict, radiance: np.ndarray, material: str) -> np.ndarray:
    """[height, width, 4] display values and coverage of the sphere that the page says it drew."""
    sphere = open_object("sphere")
    foot, up = np.array(pose["foot"]), normalize(np.array(pose["up"]))
    radius = pose["scale"] / 2
    outwards = normalize(sphere.positions - sphere.positions.mean(axis=0))
    mesh = Mesh(positions=foot + radius * (up + outwards), faces=sphere.faces, normals=sphere.normals)
    focal = max(width, height) / 2 / np.tan(np.radians(pose["longFovDeg"]) / 2)
    view = View(width=width, height=height, focal=focal, up=up)
    window = window_of(Placement(mesh=mesh, foot=foot, radius=radius, pitch_deg=0.0), view)
    drawn = draw_mesh(mesh, window.camera, radiance, MATERIALS[material])
    picture = np.zeros((height, width, 4), np.float32)
    rows, columns = np.mgrid[0 : window.size, 0 : window.size]
    y, x = rows + window.top, columns + window.left
    inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
    picture[y[inside], x[inside], :3] = response(drawn[inside][:, :3])
    picture[y[inside], x[inside], 3] = drawn[inside][:, 3]
    return picture
