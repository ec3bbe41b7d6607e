"""Placement of a virtual object: beside the real one on its ground, wholly in the photo, never over the real one.

On the side with more room, also under overhangs; on the other if only that holds it; smaller if neither does.
Where it would become too small, nearer to the camera if it covers nothing there; else beside and smaller still; else
behind the real one, which then occludes part of it.

Of that spot and of nearer, smaller ones beside, the one is taken whose size times the share of its foot on the surface
under the real object is greatest; a foot with less than STANDS of it there would seem to float, and is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.resample import resample
from anyprobe.core.response import inverse_response
from anyprobe.errors import InputError, InvalidMesh
from anyprobe.estimate.ground import contact_of
from anyprobe.estimate.photo import Photo
from anyprobe.masks.check import object_box
from anyprobe.relight.ground_view import View
from anyprobe.render.mesh import Mesh

CELLS = 128
"""Number of cells along the photo's longer side."""
RIM = 0.12
"""Reach around the foot, in the object's widths, that certainly belongs to the surface."""
HUE = 4.0
"""Weight of differences in colour shares over those of ln radiance: shadows differ in brightness."""
ALIKE = 2.5
"""Largest distance from the surface's colours, in their standard deviations, of a place on it."""
LEAST_SPREAD = 0.12
FLOOR = 0.02
"""Radiance added before its logarithm."""
UNDER, BESIDE = 0.18, (0.4, 0.9)
"""Reach to either side of the contact, in the object's widths, of the cells under it, and of those beside that."""
NARROW_HUE, NARROW_EDGE, NARROW_TIMES = 0.25, 0.4, 15.0
"""Thresholds beyond which the object stands on something narrow, such as a branch or a tripod.

The difference in colour between under and beside, and the step between neighbouring cells across them, absolute and
over the usual one. Of 33 real photos four are so: three with a branch or a tripod, and a saucer on the end of a bench.
Chosen on these photos.
"""
STANDS = 0.5
"""Smallest share of a foot's cells that must be on the surface."""


class RealSurface:
    """The surface under the real object of a photo."""

    def __init__(self, photo: Photo, contact: tuple[float, float]) -> None:
        """Find the surface.

        Args:
            contact: x, y [px] where the object touches it.
        """
        height, width = photo.mask.shape
        self.cell = max(height, width) / CELLS
        size = max(1, round(width / self.cell)), max(1, round(height / self.cell))
        linear = np.log(inverse_response(resample(photo.rgb, size)) + FLOOR)
        level = linear.mean(axis=-1, keepdims=True)
        self.features = np.concatenate([0.6 * level, HUE * 0.25 * (linear - level)], axis=-1)
        hidden = resample(photo.mask[..., None], size)[..., 0] > 0.05
        seeds = self._seeds(photo, contact, hidden)
        self.known = bool(seeds.sum() >= 4)
        self.narrow = self._is_narrow(photo, contact, hidden)
        """Whether the object stands on something narrow, so that nothing beside it stands on the same."""
        self.on = np.zeros_like(hidden)
        if self.known:
            self.on = self._alike(seeds, hidden)

    def _seeds(self, photo: Photo, contact: tuple[float, float], hidden: np.ndarray) -> np.ndarray:
        """Return the cells beside and before the foot."""
        x0, _, x1, _ = (edge / self.cell for edge in object_box(photo.mask))
        reach = max(2.0, RIM * (x1 - x0))
        row, column = np.mgrid[: hidden.shape[0], : hidden.shape[1]] + 0.5
        foot = contact[1] / self.cell
        around = (column > x0 - reach) & (column < x1 + reach) & (row > foot - 0.8 * reach) & (row < foot + 1.5 * reach)
        return around & ~hidden

    def _is_narrow(self, photo: Photo, contact: tuple[float, float], hidden: np.ndarray) -> bool:
        """Compare the cells below the contact with those beside them: another colour behind hard edges."""
        x0, _, x1, _ = (edge / self.cell for edge in object_box(photo.mask))
        wide, reach = x1 - x0, max(2.0, RIM * (x1 - x0))
        row, column = np.mgrid[: hidden.shape[0], : hidden.shape[1]] + 0.5
        foot, away = contact[1] / self.cell, np.abs(column - contact[0] / self.cell)
        band = (row > foot) & (row < foot + 1.5 * reach) & ~hidden
        under, beside = band & (away < UNDER * wide), band & (away > BESIDE[0] * wide) & (away < BESIDE[1] * wide)
        if min(under.sum(), beside.sum()) < 4:
            return False
        both = band[:, 1:] & band[:, :-1]
        steps = np.where(both, np.abs(np.diff(self.features, axis=1)).max(axis=-1), 0.0)
        edge, usual = float(np.median(steps.max(axis=1)[both.any(axis=1)])), float(np.median(steps[both]))
        colors = [np.median(self.features[cells], axis=0) for cells in (under, beside)]
        hue = np.abs((colors[0] - colors[0].mean()) - (colors[1] - colors[1].mean())).max()
        return bool(hue >= NARROW_HUE and edge >= max(NARROW_EDGE, NARROW_TIMES * usual))

    def _alike(self, seeds: np.ndarray, hidden: np.ndarray) -> np.ndarray:
        """Return the cells beside the object that have the seeds' colours and brightness."""
        middle = np.median(self.features[seeds], axis=0)
        spread = np.maximum(1.5 * np.median(np.abs(self.features[seeds] - middle), axis=0), LEAST_SPREAD)
        return ((np.abs(self.features - middle) / spread).max(axis=-1) < ALIKE) & ~hidden

    def support(self, x: float, y: float, wide: float) -> float:
        """Return the share of a foot around pixel x, y, this wide, that stands on it; 1 where it is unknown."""
        if not self.known:
            return 1.0
        reach = max(0.5 * wide / self.cell, 1.0)
        row, column = np.mgrid[: self.on.shape[0], : self.on.shape[1]] + 0.5
        across, down = (column - x / self.cell) / reach, (row - y / self.cell) / (0.5 * reach)
        foot = across**2 + down**2 <= 1
        return float(self.on[foot].mean()) if foot.any() else 0.0


LEAST_SHARE, LEAST_BESIDE = 0.35, 0.2
"""Smallest share of the requested size beside the real object or in front of it, and beside it where both are too
narrow: a small object that stands is better than one behind, which seldom seems to."""

FRONT_ROWS = (0.25, 0.5, 0.75, 1.0)
"""Places in front that are tried, from the row that the real object stands on (0) to the lowest of the photo (1)."""

_MARGIN, GAP = 0.02, 0.15
"""Margins kept free: at the photo's border, in its widths; and between the two objects, in the virtual one's."""

FLAT = 0.6
"""Smallest height of a real object, in its widths; a flatter one counts as this high."""

LEAST_HEIGHT = 1e-3
"""Smallest height of a virtual object, in its widths: sizes are given by height."""

NEARER_SHARES = (1.0, 0.75, 0.55, 0.4)
"""Shares of the fitting size that are tried on both sides: smaller objects stand nearer."""

TRIES, LEAST_STEP, CLOSE_PX = 24, 0.5, 0.5
"""Number of fitting steps, smallest factor of one step, and pixels that do not matter."""

_Box = tuple[float, float, float, float]
"""Left, top, right, bottom [px]."""


class Side(StrEnum):
    """Side of the real object on which the virtual one stands; "asked" where the caller chose the place."""

    asked = "asked"
    beside = "beside"
    front = "front"
    behind = "behind"


@dataclass(frozen=True, kw_only=True, slots=True)
class Placement:
    """A mesh placed on the ground.

    mesh: in the camera's frame. foot: [3] point of the ground below its middle. radius: of the
    smallest sphere around it. pitch_deg: camera's, downwards. share: its size over the requested one.
    side: in front of or behind the real object for want of room beside; behind, it is partly occluded.
    """

    mesh: Mesh
    foot: np.ndarray
    radius: float
    pitch_deg: float
    share: float = 1.0
    side: Side = Side.asked


@dataclass(frozen=True, kw_only=True, slots=True)
class Spot:
    """Pixel x, y of the foot, and size as a share of the requested one."""

    x: float
    y: float
    share: float


Extent = Callable[[Spot], _Box]
"""Function that returns the pixels the object covers at a spot."""


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
        size: its height over that of the real object, which stands on its mask's lower border.
        at: x, y of its foot [px], where it keeps its full size; by default it stands beside the real
            object, the lowest visible points of both on one row, and is made smaller until it fits.
        turn_deg: about its vertical axis.
    Raises:
        InputError: no ground is visible at that pixel, the surface under the real object does not go on beside it, or
            the mesh is flat.
    """
    check_height(mesh)
    box, (x, row) = object_box(photo.mask), contact_of(photo.mask)
    depth = -view.on_ground(x, row)[2]
    real = max(box[3] - box[1], FLAT * (box[2] - box[0]))
    height = real / view.focal * depth * size
    rolled = rotation_z(-np.arctan2(view.up[0], view.up[1]))
    upright = rolled @ rotation_x(np.radians(pitch_deg)) @ rotation_y(np.radians(turn_deg))
    unit = _unit_high(mesh)
    if at is not None:
        foot = view.on_ground(*at)
        if not np.isfinite(foot).all():
            raise InputError(
                f"{at[0]:g},{at[1]:g} is above the horizon; point lower, or pitch the camera down", subject="at"
            )
        return _standing(unit, upright, foot, height, pitch_deg)
    turned = unit.positions @ upright.T

    def extent_at(spot: Spot) -> _Box:
        pixels = view.pixels(turned * (height * spot.share) + _foot(view, spot))
        return (*pixels.min(axis=0), *pixels.max(axis=0))

    back = (box[2] - box[0]) / 2 / view.focal * depth + min(height, height / size) / 2
    outline, surface = Outline(photo.mask), RealSurface(photo, (x, row))
    if surface.narrow:
        raise _no_place("something narrow")
    fitting, side = find_spot(view, outline, row, view.row_at_depth(depth + back), min(1.0, 1 / size), extent_at)
    spots = [(fitting, side), *_nearer(view, outline, row, fitting.share, extent_at)]

    def score(spot: Spot, side: Side) -> float:
        left, _, right, _ = extent_at(spot)
        support = 1.0 if side == Side.behind else surface.support(spot.x, spot.y, right - left)
        return spot.share * support if support >= STANDS else 0.0

    scores = [score(*one) for one in spots]
    if not max(scores) > 0:
        raise _no_place("a surface that ends there")
    spot, side = spots[int(np.argmax(scores))]
    placed = _standing(unit, upright, _foot(view, spot), height * spot.share, pitch_deg)
    return replace(placed, share=spot.share, side=side)


def _no_place(found: str) -> InputError:
    text = f"expected the surface under the object to go on beside it, got {found}; point to where it shall stand"
    return InputError(text, subject="at")


def check_foot(at: tuple[float, float] | None, height: int, width: int) -> None:
    """Raise InputError if the pixel x, y is outside a photo of this size."""
    if at is not None and not (0 <= at[0] <= width and 0 <= at[1] <= height):
        text = f"expected a pixel of {width} x {height}, got {at[0]:g},{at[1]:g}; choose another"
        raise InputError(text, subject="at")


def check_height(mesh: Mesh) -> None:
    """Raise InvalidMesh if a mesh lies flat: sizes are relative to its height."""
    width, height, depth = np.ptp(mesh.positions, axis=0)
    if height < LEAST_HEIGHT * max(width, depth):
        raise InvalidMesh(
            "expected a mesh with a height, got one that lies flat; turn it so that +Y is up", subject="mesh"
        )


class Outline:
    """Extent of the real object to either side, row by row of its mask [H, W]."""

    def __init__(self, mask: np.ndarray) -> None:
        inside, self.width = mask > 0.5, mask.shape[1]
        self.box: _Box = object_box(mask)
        there = inside.any(axis=1)
        self._left = np.where(there, inside.argmax(axis=1), self.width)
        self._right = np.where(there, self.width - inside[:, ::-1].argmax(axis=1), 0)

    def free(self, top: float, bottom: float, side: int, bounds: _Box) -> tuple[float, float]:
        """Return the left and right bound of the free space in rows top to bottom, on one side (1: right, -1: left)."""
        rows = slice(max(int(np.floor(top)), 0), max(int(np.ceil(bottom)), 1))
        if side > 0:
            return max(float(self._right[rows].max(initial=0)), bounds[0]), bounds[2]
        return bounds[0], min(float(self._left[rows].min(initial=self.width)), bounds[2])


def find_spot(
    view: View, outline: Outline, row: float, behind: float, most_behind: float, extent_at: Extent
) -> tuple[Spot, Side]:
    """Find a spot where an object fits, and its side of the real one.

    Args:
        row: both stand on it. behind: row of the ground behind the real object. most_behind: largest share of the
            requested size tried there.
    """
    edge = _MARGIN * view.width
    bounds = edge, edge, view.width - edge, view.height - edge
    left, _, right, _ = outline.box
    sides = [(right, 1), (left, -1)] if view.width - right >= left else [(left, -1), (right, 1)]

    def fitted(foot_row: float) -> Spot:
        first, second = (
            _fit(Spot(x=x, y=foot_row, share=1.0), bounds, view.farthest_row, extent_at, outline, side)
            for x, side in sides
        )
        return second if second.share > first.share + 0.01 else first

    beside = fitted(row)
    if beside.share >= LEAST_SHARE:
        return beside, Side.beside
    nearer = [fitted(row + share * (bounds[3] - row)) for share in FRONT_ROWS if row < bounds[3]]
    front = max(nearer, key=lambda spot: spot.share, default=beside)
    if front.share >= LEAST_SHARE:
        return front, Side.front
    if beside.share >= LEAST_BESIDE:
        return beside, Side.beside
    far = Spot(x=view.width if sides[0][1] > 0 else 0, y=behind, share=most_behind)
    return _fit(far, bounds, view.farthest_row, extent_at), Side.behind


def _nearer(view: View, outline: Outline, row: float, share: float, extent_at: Extent) -> Iterator[tuple[Spot, Side]]:
    """Yield spots of NEARER_SHARES of a share on both sides of an outline."""
    edge = _MARGIN * view.width
    bounds = edge, edge, view.width - edge, view.height - edge
    for x, sign in ((outline.box[2], 1), (outline.box[0], -1)):
        for smaller in NEARER_SHARES:
            spot = Spot(x=x, y=row, share=share * smaller)
            yield _fit(spot, bounds, view.farthest_row, extent_at, outline, sign), Side.beside


def _fit(
    spot: Spot, bounds: _Box, far_row: float, extent_at: Extent, outline: Outline | None = None, side: int = 0
) -> Spot:
    """Move a spot into the bounds, and to one side of an outline (1: right, -1: left), GAP off it, its lowest point on
    the spot's row; smaller if needed.

    Nearer objects are drawn larger, so that place and size depend on each other: later steps only make it smaller.
    """
    x, row, share = spot.x, spot.y, spot.share
    y = row
    left, top, right, bottom = bounds
    for i in range(TRIES):
        x0, y0, x1, y1 = extent_at(Spot(x=x, y=y, share=share))
        down = min(bottom, row) - y1 if side else _into(y0, y1, top, bottom)
        if outline is not None:
            left, right = outline.free(y0 + down, y1 + down, side, bounds)
        wide, tall = (x1 - x0) * (1 + abs(side) * GAP), (min(y1, bottom) if side else bottom) - top
        room = min((right - left) / wide, tall / (y1 - y0))
        larger = min(max(room, LEAST_STEP), spot.share / share if i < TRIES / 2 else 1.0, 1 / LEAST_STEP)
        apart = side * GAP * (x1 - x0)
        across = (left + apart - x0, right + apart - x1)[side < 0] if side else _into(x0, x1, left, right)
        if abs(larger - 1) < 0.001 and max(abs(across), abs(down)) < CLOSE_PX:
            break
        x, y, share = float(np.clip(x + across, left, right)), max(y + down, far_row), share * larger
    return Spot(x=x, y=y, share=share)


def _into(low: float, high: float, least: float, most: float) -> float:
    """Return the shift that moves a span into another."""
    return max(least - low, 0.0) - max(high - most, 0.0)


def _foot(view: View, spot: Spot) -> np.ndarray:
    """Return the ground at a spot, or at the farthest visible ground."""
    return view.on_ground(spot.x, max(spot.y, view.farthest_row))


def _unit_high(mesh: Mesh) -> Mesh:
    """Scale a mesh to height one, standing on the origin."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    bottom = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(mesh, positions=(mesh.positions - bottom) / float(high[1] - low[1]))


def _standing(unit: Mesh, upright: np.ndarray, foot: np.ndarray, height: float, pitch_deg: float) -> Placement:
    middle = np.array([0.0, 0.5, 0.0])
    radius = height * float(np.linalg.norm(unit.positions - middle, axis=1).max())
    positions = unit.positions @ upright.T * height + foot
    normals = (unit.normals @ upright.T).astype(np.float32)
    placed = Mesh(positions=positions, faces=unit.faces, normals=normals)
    return Placement(mesh=placed, foot=foot, radius=radius, pitch_deg=pitch_deg)
