"""The real object's form, guessed from its mask: an upright body of elliptic sections whose back is as its front."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.estimate.ground import contact_of
from anyprobe.estimate.photo import Photo
from anyprobe.masks.check import object_box
from anyprobe.relight.ground_view import View
from anyprobe.relight.placement import Placement
from anyprobe.render.mesh import Mesh

ROWS, SECTORS = 32, 32
"""Largest number of rows, and number of cells around, of the body."""
LEAST_ROWS = 4
"""Smallest height [px] of a real object that is modelled."""
LEAST_AWAY = 0.2
"""Smallest distance along the ground from the camera, in its heights: from straight above, no side is seen."""
DEPTH, LEAST_DEPTH = 0.8, 0.1
"""Depth of the real object, in its widths, and the smallest, where the inserted one stands before or behind it.

The shadow of a rendered pebble in low sun is met with an intersection over union of .76, .88, .92 and .81 by depths of
.35, .6, .8 and 1.
"""

LIKELY = 0.2
"""Share by which the real object is as likely narrower or wider; bodies of 17 training assets are farther off."""


def real_body(photo: Photo, view: View, spot: Placement) -> Mesh | None:
    """Return the real object's body on and above the ground, without normals.

    None where there is none, where its form says too little, or without room for both.
    """
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
    rows = np.unique(np.linspace(top, bottom - 1, ROWS).round().astype(int))
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
    # the upper outline is seen past the middle: of an ellipsoid with half axes a and b, at sqrt(a^2 + b^2 tan^2)
    upper = np.maximum((middle - middle[len(middle) // 2]) @ view.up, 0.0)
    beyond = DEPTH * half.max() / np.linalg.norm(away)  # the camera's height is one
    lower = 1.0 - np.sqrt(max(1.0 - (beyond / max(upper.max(), 1e-9)) ** 2, 0.0))
    middle = middle - lower * upper[:, None] * view.up
    flat = _flattened(spot, middle, half, view.up, right, toward)
    if flat is None:
        return None
    angle = np.arange(SECTORS) * 2 * np.pi / SECTORS
    around = np.cos(angle)[:, None] * right + flat * np.sin(angle)[:, None] * toward
    rings = np.concatenate([middle[:1, None] + 0 * around, middle[:, None] + half[:, None, None] * around])  # a lid
    corner = np.arange(rings.shape[0] * SECTORS).reshape(-1, SECTORS)
    after = np.roll(corner, -1, axis=1)
    a, b, c, d = corner[:-1], after[:-1], after[1:], corner[1:]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    positions = rings.reshape(-1, 3)
    below = np.minimum((positions - spot.foot) @ view.up, 0.0)
    positions = positions - below[:, None] * view.up
    return Mesh(positions=positions, faces=faces, normals=np.zeros((len(faces), 3, 3), np.float32))


def likely_bodies(body: Mesh, up: np.ndarray) -> list[Mesh]:
    """Return a real object's body and ones LIKELY narrower and wider: their mean shadow is the one to expect."""
    middle = body.positions.mean(axis=0)
    level = (body.positions - middle) @ (np.eye(len(up)) - np.outer(up, up))
    return [body, *(replace(body, positions=body.positions + more * level) for more in (-LIKELY, LIKELY))]


def _flattened(
    spot: Placement, middle: np.ndarray, half: np.ndarray, up: np.ndarray, right: np.ndarray, toward: np.ndarray
) -> float | None:
    """Return the real object's depth over its width that leaves the inserted one its place; None without room.

    middle [R, 3], half [R]: of the rows, from the top down.
    """
    own, rows = spot.mesh.positions - spot.foot, (middle - spot.foot)[::-1]
    height, heights = own @ up, rows @ up
    axis = np.stack([np.interp(height, heights, rows[:, k]) for k in range(3)], axis=-1)
    wide = np.interp(height, heights, half[::-1], right=0.0)
    across, before = (np.abs((own - axis) @ way) for way in (right, toward))
    level = across < wide
    room = before[level] / np.sqrt(wide[level] ** 2 - across[level] ** 2)
    flat = float(room.min(initial=DEPTH))
    return None if flat < LEAST_DEPTH else flat
