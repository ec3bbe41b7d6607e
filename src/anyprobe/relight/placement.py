"""A place for a virtual object: beside the real one on its ground, all of it in the photo, never over the real one.

On the side with more room; on the other if only that holds it; smaller if neither does; and where it would become too
small, behind the real one, which then hides part of it. web/page/view/placement.js does the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.errors import InputError
from anyprobe.estimate.photo import Photo, object_box
from anyprobe.relight.ground import View, contact_of
from anyprobe.render.mesh import Mesh

LEAST_SHARE = 0.35
"""Of what was asked: beside the real object it is made no smaller."""

MARGIN, GAP = 0.02, 0.15
"""Kept free at the photo's border, of its width; and between the two objects, of the virtual one's."""

FLAT = 0.6
"""A real object that is flatter than this counts as so high, of its width."""

TRIES, LEAST_STEP, CLOSE_PX = 24, 0.5, 0.5
"""To fit it, how much smaller each may make it, and pixels that do not matter."""

Box = tuple[float, float, float, float]
"""Left, top, right, bottom [px]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Placement:
    """A mesh on the ground.

    mesh: in the camera's frame. foot: [3] point of the ground below its middle. radius: of the
    smallest sphere around it. pitch_deg: camera's, downwards. share: its size over what was asked.
    is_behind: the real object hides part of it, for want of room beside.
    """

    mesh: Mesh
    foot: np.ndarray
    radius: float
    pitch_deg: float
    share: float = 1.0
    is_behind: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class Spot:
    """Pixel x, y of the foot, and size as a share of what was asked."""

    x: float
    y: float
    share: float


Extent = Callable[[Spot], Box]
"""What the object covers at a spot."""


def place_beside(
    mesh: Mesh,
    photo: Photo,
    view: View,
    pitch_deg: float,
    size: float = 0.5,
    at: tuple[float, float] | None = None,
    turn_deg: float = 0.0,
) -> Placement:
    """Stand a mesh (+Y up) on the ground of a photo.

    Args:
        size: its height over that of the real object, which stands where its mask's lower border is.
        at: x, y of its foot [px], where it stands as large as asked; unless given it stands beside the real
            object, the lowest that is seen of both on one row, and is made smaller until it fits.
        turn_deg: about its vertical axis.
    Raises:
        InputError: nothing of the ground is seen at that pixel.
    """
    box, (x, row) = object_box(photo.mask), contact_of(photo.mask)
    depth = -view.on_ground(x, row)[2]
    real = max(box[3] - box[1], FLAT * (box[2] - box[0]))
    height = real / view.focal * depth * size
    upright = rotation_x(np.radians(pitch_deg)) @ rotation_y(np.radians(turn_deg))
    unit = _unit_high(mesh)
    if at is not None:
        foot = view.on_ground(*at)
        if not np.isfinite(foot).all():
            raise InputError(
                f"--at: expected a point of the ground, got {at[0]:g},{at[1]:g} above the horizon; "
                "point lower, or give --pitch"
            )
        return _standing(unit, upright, foot, height, pitch_deg)
    turned = unit.positions @ upright.T

    def extent_at(spot: Spot) -> Box:
        pixels = view.pixels(turned * (height * spot.share) + _foot(view, spot))
        return (*pixels.min(axis=0), *pixels.max(axis=0))

    behind = view.row_at_depth(depth + (box[2] - box[0]) / view.focal * depth + min(height, height / size))
    spot, is_behind = find_spot(view, box, row, behind, min(1.0, 1 / size), extent_at)
    placed = _standing(unit, upright, _foot(view, spot), height * spot.share, pitch_deg)
    return replace(placed, share=spot.share, is_behind=is_behind)


def find_spot(
    view: View, box: Box, row: float, behind: float, most_behind: float, extent_at: Extent
) -> tuple[Spot, bool]:
    """Where an object fits beside a box, and whether it had to stand behind it instead.

    Args:
        row: on which both stand. behind: row of the ground behind the real object. most_behind: the share of what
            was asked that is tried there.
    """
    edge = MARGIN * view.width
    top, bottom = edge, view.height - edge
    sides = [(box[2], 1, (box[2], top, view.width - edge, bottom)), (box[0], -1, (edge, top, box[0], bottom))]
    if view.width - box[2] < box[0]:
        sides.reverse()
    far_row = view.farthest_row
    found = [_fit(Spot(x=x, y=row, share=1.0), bounds, gap, far_row, extent_at) for x, gap, bounds in sides]
    best = found[1] if found[1].share > found[0].share + 0.01 else found[0]
    if best.share >= LEAST_SHARE:
        return best, False
    far = Spot(x=view.width if sides[0][1] > 0 else 0, y=behind, share=most_behind)
    return _fit(far, (edge, top, view.width - edge, bottom), 0, far_row, extent_at), True


def _fit(spot: Spot, bounds: Box, gap: int, far_row: float, extent_at: Extent) -> Spot:
    """Moved into the bounds, GAP off the side where the real object is (gap 1: left), on its row; smaller if needed.

    What is nearer is drawn larger, so that place and size depend on each other: later tries only make it smaller.
    """
    x, row, share = spot.x, spot.y, spot.share
    y = row
    left, top, right, bottom = bounds
    if right - left < 1:
        return replace(spot, share=0.0)
    for i in range(TRIES):
        x0, y0, x1, y1 = extent_at(Spot(x=x, y=y, share=share))
        wide, tall = (x1 - x0) * (1 + abs(gap) * GAP), (min(y1, bottom) if gap else bottom) - top
        room = min((right - left) / wide, tall / (y1 - y0))
        larger = min(max(room, LEAST_STEP), spot.share / share if i < TRIES / 2 else 1.0, 1 / LEAST_STEP)
        apart = gap * GAP * (x1 - x0)
        across = (left + apart - x0, right + apart - x1)[gap < 0] if gap else _into(x0, x1, left, right)
        down = min(bottom, row) - y1 if gap else _into(y0, y1, top, bottom)
        if abs(larger - 1) < 0.001 and max(abs(across), abs(down)) < CLOSE_PX:
            break
        x, y, share = float(np.clip(x + across, left, right)), max(y + down, far_row), share * larger
    return Spot(x=x, y=y, share=share)


def _into(low: float, high: float, least: float, most: float) -> float:
    """How far a span must go to lie in another."""
    return max(least - low, 0.0) - max(high - most, 0.0)


def _foot(view: View, spot: Spot) -> np.ndarray:
    """The ground at a spot, or as far back as ground is seen."""
    return view.on_ground(spot.x, max(spot.y, view.farthest_row))


def _unit_high(mesh: Mesh) -> Mesh:
    """One unit high, standing on the origin."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    bottom = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(mesh, positions=(mesh.positions - bottom) / max(float(high[1] - low[1]), 1e-6))


def _standing(
    unit: Mesh, upright: np.ndarray, foot: np.ndarray, height: float, pitch_deg: float
) -> Placement:
    middle = np.array([0.0, 0.5, 0.0])
    radius = height * float(np.linalg.norm(unit.positions - middle, axis=1).max())
    positions = unit.positions @ upright.T * height + foot
    normals = (unit.normals @ upright.T).astype(np.float32)
    placed = Mesh(positions=positions, faces=unit.faces, normals=normals)
    return Placement(mesh=placed, foot=foot, radius=radius, pitch_deg=pitch_deg)
