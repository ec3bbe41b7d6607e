"""Surfaces around an inserted object that show the photo, for the path tracer: the ground and the real object.

Each sends out the radiance that the photo shows there and reflects nothing more, so that the inserted object is lit by
them, mirrors them, and lies in the real object's shade. The ground is darker by the inserted object's own shadow.
Of the real object only one side is seen: it counts as an upright body of elliptic sections, its back as its front.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.frames import orthonormal_basis, rotation_z
from anyprobe.estimate.ground import contact_of
from anyprobe.estimate.photo import Photo
from anyprobe.masks.check import object_box
from anyprobe.relight.ground_map import GroundPicture, radiance_at
from anyprobe.relight.ground_view import View
from anyprobe.relight.placement import Placement
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.mesh import Mesh
from anyprobe.scatter.materials import Material

GROUND_RADII = 0.01, 30.0
"""Radii of the ground's innermost and outermost ring, in those of the inserted object."""
GROUND_RINGS, GROUND_SECTORS = 96, 128
"""Numbers of cells of the ground's mesh, outwards and around."""
GROUND_TEXELS = 512, 1024
"""Texels of the ground's picture, outwards and around; the rows are evenly spaced in the logarithm of the radius."""
GROUND_STRIPS = 32
"""Parts in which the picture is read: all at once would take 115 MB."""
BODY_ROWS, BODY_SECTORS = 256, 64
"""Largest number of rows, and number of cells around, of the real object's mesh."""
BODY_TEXELS = 256
"""Texels around it."""
INSET = 0.96
"""Share of a row's half width from which its colours are read: masks are a pixel too wide in places."""
STANDING_ROWS, STANDING_SECTORS = 32, 32
"""Largest number of rows, and number of cells around, of its mesh where only its shade counts."""
TURNS_DEG = tuple(np.linspace(-30.0, 30.0, 6))
"""Turns of the real object about the inserted one: evenly over the usual error of the light's direction."""
BLURRING = 0.3
"""Smallest alpha of a material that does not mirror the real object, so that only its shade and tint are seen."""
LEAST_ROWS = 4
"""Smallest height [px] of a real object that is modelled."""
LEAST_AWAY = 0.2
"""Smallest distance along the ground from the camera, in its heights: from straight above, no side is seen."""
DEPTH, LEAST_DEPTH = 0.35, 0.1
"""Depth of the real object, in its widths, and the smallest, where the inserted one stands before or behind it.

A body as deep as wide shades inserted objects too much. Chosen of 0, .35, .6 and 1 on seven left-out renders.
"""
LIFT = 1e-4
"""Distance of the ground below the foot, in the camera's heights: below the inserted mesh's own lowest faces."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ShownSurface:
    """A grid that sends out light on one side.

    points: [R, C, 3] corners; its front is where the cross product of a step along a row and one down a column points.
    radiance: [h, w, 3] over the grid: the middles of its first and last row lie on those of the corners, and it
    goes on periodically along rows.
    """

    points: np.ndarray
    radiance: np.ndarray

    def mesh(self, rows: int, columns: int) -> Mesh:
        """Return its form, of at most so many rows and columns of cells, without normals."""
        down, along = (
            np.unique(np.linspace(0, count - 1, most + 1).round().astype(int))
            for count, most in zip(self.points.shape[:2], (rows, columns), strict=True)
        )
        corner = np.arange(len(down) * len(along)).reshape(len(down), len(along))
        a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
        faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
        positions = self.points[down][:, along].reshape(-1, 3)
        return Mesh(positions=positions, faces=faces, normals=np.zeros((len(faces), 3, 3), np.float32))


def shown_ground(picture: GroundPicture, view: View, spot: Placement, shadow: GroundShadow) -> ShownSurface:
    """Return the ground around an inserted object, with its shadow on it."""
    side, across = orthonormal_basis(view.up)
    low, high = (np.log(radius * spot.radius) for radius in GROUND_RADII)

    def rings(radii: np.ndarray, angles: np.ndarray) -> np.ndarray:
        along = np.cos(angles)[:, None] * side - np.sin(angles)[:, None] * across
        return spot.foot + radii[:, None, None] * along

    rows, columns = GROUND_TEXELS
    middles = (np.arange(columns) + 0.5) / columns * 2 * np.pi
    strips = []
    for radii in np.array_split(np.exp(np.linspace(low, high, rows)), GROUND_STRIPS):
        points = rings(radii, middles).reshape(-1, 3)
        strips.append((picture.at(points) * shadow.at(points)).reshape(-1, columns, 3).astype(np.float32))
    corners = rings(np.exp(np.linspace(low, high, GROUND_RINGS + 1)), np.linspace(0, 2 * np.pi, GROUND_SECTORS + 1))
    return ShownSurface(points=corners - LIFT * view.up, radiance=np.concatenate(strips))


def shown_object(photo: Photo, view: View, spot: Placement) -> ShownSurface | None:
    """Return the real object; None where there is none, where its form says too little, or without room for both."""
    inside = photo.mask > 0.5
    if not inside.any():
        return None
    (x, bottom), top = contact_of(photo.mask), object_box(photo.mask)[1]
    contact = view.on_ground(x, bottom)
    away = -contact - view.up * float(-contact @ view.up)  # along the ground to the camera
    if bottom - top < LEAST_ROWS or not np.isfinite(contact).all() or np.linalg.norm(away) < LEAST_AWAY:
        return None
    toward = away / np.linalg.norm(away)
    right = np.cross(view.up, toward)
    rows = np.unique(np.linspace(top, bottom - 1, BODY_ROWS).round().astype(int))
    rows = rows[inside[rows].any(axis=1)]
    first = inside[rows].argmax(axis=1)
    last = inside.shape[1] - inside[rows, ::-1].argmax(axis=1)

    def upright(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return middles [R, 3] and half widths [R] of the rows in the vertical plane through a point."""
        ends = [view.rays(columns, rows + 0.5) for columns in (first, last)]
        ends = [rays * ((point @ toward) / np.minimum(rays @ toward, -1e-6))[:, None] for rays in ends]
        return (ends[0] + ends[1]) / 2, np.linalg.norm(ends[1] - ends[0], axis=-1) / 2

    base = upright(contact)[1][-1]
    middle, half = upright(contact - DEPTH * base * toward)  # what is seen to touch the ground is the front of the base
    height = (spot.mesh.positions - spot.foot) @ view.up
    low = (middle - spot.foot) @ view.up < height.max()  # a spout above it is not in its way
    flat = _flattened(spot, middle[low], half[low], right, toward)
    if flat is None:
        return None
    angle = np.linspace(0, 2 * np.pi, BODY_SECTORS + 1)
    around = np.cos(angle)[:, None] * right + flat * np.sin(angle)[:, None] * toward
    points = middle[:, None] + half[:, None, None] * around
    lid = np.broadcast_to(middle[:1, None], points[:1].shape)
    colors = _colors(photo, rows, first, last)
    return ShownSurface(points=np.concatenate([lid, points]), radiance=np.concatenate([colors[:1], colors]))


def standing_object(photo: Photo, view: View, spot: Placement) -> Mesh | None:
    """Return the form of shown_object, coarse, on and above the ground."""
    real = shown_object(photo, view, spot)
    if real is None:
        return None
    mesh = real.mesh(STANDING_ROWS, STANDING_SECTORS)
    below = np.minimum((mesh.positions - spot.foot) @ view.up, 0.0)
    return replace(mesh, positions=mesh.positions - below[:, None] * view.up)


def _turned_about(surface: ShownSurface, spot: Placement, up: np.ndarray, turn_deg: float) -> ShownSurface:
    """Turn a surface about the upright axis through an inserted object, which it comes no nearer."""
    side, across = orthonormal_basis(up)
    frame = np.stack([side, across, up])
    turn = frame.T @ rotation_z(np.radians(turn_deg)) @ frame
    return replace(surface, points=(surface.points - spot.foot) @ turn.T + spot.foot)


def likely_places(
    around: Sequence[ShownSurface], spot: Placement, up: np.ndarray, material: Material
) -> list[list[ShownSurface]]:
    """Return surroundings, of a ground and perhaps a real object, that are equally likely from an inserted one.

    The light's direction is known to within TURNS_DEG only, and so is which part lies in the real object's shade. On a
    material that mirrors nothing the mean over them counts: a shade without the hard edges of one place that is seldom
    right. Turning the object instead of the light leaves the light's own shading as it is.
    """
    if len(around) == 1 or material.alpha < BLURRING:
        return [list(around)]
    ground, real = around
    return [[ground, _turned_about(real, spot, up, turn_deg)] for turn_deg in TURNS_DEG]


def _flattened(
    spot: Placement, middle: np.ndarray, half: np.ndarray, right: np.ndarray, toward: np.ndarray
) -> float | None:
    """Return the real object's depth over its width that leaves the inserted one its place; None without room.

    middle, half: of the rows at the inserted one's height.
    """
    if not len(half):
        return DEPTH
    beside, before = (np.abs((spot.foot - middle) @ axis) for axis in (right, toward))
    if (beside >= half + spot.radius).all():
        return DEPTH
    room = float((before.min() - spot.radius) / half.max())
    return None if room < LEAST_DEPTH else min(room, DEPTH)


def _colors(photo: Photo, rows: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return the radiance [R, BODY_TEXELS, 3] of rows of the real object from right to left and back."""
    across = INSET * np.cos((np.arange(BODY_TEXELS) + 0.5) / BODY_TEXELS * 2 * np.pi)
    columns = ((first + last) / 2)[:, None] + ((last - first) / 2)[:, None] * across
    columns = np.clip(columns, 0, photo.mask.shape[1] - 1).astype(int)
    lines = np.broadcast_to(rows[:, None], columns.shape)
    shown = radiance_at(photo, lines, columns)
    own = (photo.mask[lines, columns] > 0.5)[..., None]  # not between a pot and its handle
    mean = (shown * own).sum(axis=1, keepdims=True) / np.maximum(own.sum(axis=1, keepdims=True), 1)
    return np.where(own, shown, mean).astype(np.float32)
