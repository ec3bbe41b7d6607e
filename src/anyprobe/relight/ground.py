"""Where things stand: the photo's camera over a horizontal plane, and a place on it beside the object.

Everything is in the camera's frame (+X right, +Y up, looking along -Z); the unit of length is the
camera's height over the ground, which a photo does not determine and nothing here needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.errors import InputError
from anyprobe.estimate.photo import Photo, object_box
from anyprobe.render.mesh import Mesh

LEAST_SLOPE_DEG = 12.0
"""The ground at the real object's base is seen at least this far below the horizon."""

UNKNOWN_LENS_DEG = 38.0
"""Along the longer side, where neither EXIF nor the caller gives it. Of a cropped or zoomed photo the 65
degrees that estimates take would stretch a sphere near its border; too narrow a guess shows far less."""

GAP = 0.15
"""Between the real object and the virtual one, in widths of the latter."""

LEAST_SIZE = 0.35
"""A virtual object is not made smaller than this share of what was asked to fit beside the real one."""

STRIP_PIXELS = 1 << 18
"""Of the photo, whose places on the ground are worked out at once: some 200 bytes each."""

MARGIN = 0.02
"""Kept free at the picture's border, of its width."""

MOST_FITS, LEAST_STEP = 16, 0.5
"""Tries to place an object wholly inside the picture, and how much smaller each may make it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class View:
    """A pinhole photo over the plane up . x = -1.

    width, height: of the photo [px]. focal: [px]. up: [3] unit vector away from the ground.
    """

    width: int
    height: int
    focal: float
    up: np.ndarray

    @property
    def long_fov_deg(self) -> float:
        """Field of view of the longer side."""
        return float(np.degrees(2 * np.arctan(max(self.width, self.height) / 2 / self.focal)))

    def rays(self, x, y) -> np.ndarray:
        """Directions [..., 3] with z = -1 through points of the photo; pixel i covers [i, i + 1)."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        return np.stack(
            [(x - self.width / 2) / self.focal, (self.height / 2 - y) / self.focal, -np.ones_like(x)], axis=-1
        )

    def on_ground(self, x, y) -> np.ndarray:
        """Points [..., 3] of the ground seen at x, y; NaN from the horizon upwards."""
        rays = self.rays(x, y)
        down = -(rays @ self.up)
        return rays / np.where(down > 1e-4, down, np.nan)[..., None]

    def ground_strips(self) -> Iterator[tuple[slice, np.ndarray]]:
        """on_ground of all pixels' centres from the top down, a few rows at a time: which rows, and [R, W, 3]."""
        step = max(1, STRIP_PIXELS // self.width)
        for top in range(0, self.height, step):
            strip = slice(top, min(top + step, self.height))
            rows, columns = np.mgrid[strip, 0 : self.width] + 0.5
            yield strip, self.on_ground(columns.ravel(), rows.ravel()).reshape(*rows.shape, 3)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Where points [..., 3] in front of the camera appear, [..., 2] px."""
        depth = np.maximum(-points[..., 2], 1e-6)
        return np.stack(
            [
                self.width / 2 + self.focal * points[..., 0] / depth,
                self.height / 2 - self.focal * points[..., 1] / depth,
            ],
            axis=-1,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Placement:
    """A mesh on the ground.

    mesh: in the camera's frame. foot: [3] point of the ground below its middle. radius: of the
    smallest sphere around it. pitch_deg: camera's, downwards.
    """

    mesh: Mesh
    foot: np.ndarray
    radius: float
    pitch_deg: float


def view_of(photo: Photo, pitch_deg: float | None = None) -> tuple[View, float]:
    """The photo's camera over its ground, and the pitch taken.

    Args:
        pitch_deg: how far the camera looks down. Unless given it is level, or looks down just enough
            to see the ground at the object's base LEAST_SLOPE_DEG below the horizon.
    Raises:
        InputError: the base would lie at or above the horizon.
    """
    height, width = photo.mask.shape
    long_fov_deg = UNKNOWN_LENS_DEG if photo.fov_source == "default" else photo.long_fov_deg
    focal = max(width, height) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    base = object_box(photo.mask)[3]
    below_axis = np.degrees(np.arctan2(base - height / 2, focal))
    if pitch_deg is None:
        pitch_deg = float(max(0.0, LEAST_SLOPE_DEG - below_axis))
    if not (-60 <= pitch_deg <= 90 and below_axis + pitch_deg > 1.0):
        raise InputError(
            f"--pitch: expected the object's base below the horizon, got a camera that looks "
            f"{pitch_deg:g} degrees down and a base {below_axis:.0f} degrees below its axis; give another"
        )
    tilt = np.radians(pitch_deg)
    up = np.array([0.0, np.cos(tilt), np.sin(tilt)])
    return View(width=width, height=height, focal=float(focal), up=up), pitch_deg


def place_beside(
    mesh: Mesh,
    photo: Photo,
    view: View,
    pitch_deg: float,
    size: float = 0.8,
    at: tuple[float, float] | None = None,
    turn_deg: float = 0.0,
) -> Placement:
    """Stand a mesh (+Y up) on the ground of a photo.

    Args:
        size: its largest extent over that of the real object, whose foot is at the mask's lower edge.
        at: x, y of its foot [px]; unless given, it stands on the side with more room, its lowest
            point on the row of the mask's, and is made smaller down to LEAST_SIZE of the size to fit there;
            where that is too large yet, it stands in front of the real object, and is made smaller
            until all of it is in the picture.
        turn_deg: about its vertical axis.
    """
    x0, y0, x1, y1 = object_box(photo.mask)
    base = view.on_ground((x0 + x1) / 2, y1)
    extent = max(x1 - x0, y1 - y0) / view.focal * -base[2] * size
    upright = rotation_x(np.radians(pitch_deg)) @ rotation_y(np.radians(turn_deg))
    if at is not None:
        foot = view.on_ground(*at)
        if not np.isfinite(foot).all():
            raise InputError(
                f"--at: expected a point of the ground, got {at[0]:g},{at[1]:g} above the horizon; "
                "point lower, or give --pitch"
            )
        return _standing(mesh, upright, foot, extent, pitch_deg)
    right = view.width - x1 >= x0
    room = max(view.width - x1, x0) - MARGIN * view.width
    placed = _on_row(mesh, upright, view, extent, y1, (x0 + x1) / 2, pitch_deg)
    wide = np.ptp(view.pixels(placed.mesh.positions)[:, 0]) * (1 + GAP)
    extent *= float(np.clip(room / wide, LEAST_SIZE, 1.0))
    placed = _on_row(mesh, upright, view, extent, y1, (x0 + x1) / 2, pitch_deg)
    wide = np.ptp(view.pixels(placed.mesh.positions)[:, 0])
    x = x1 + wide * (0.5 + GAP) if right else x0 - wide * (0.5 + GAP)
    return _inside(mesh, upright, view, extent, y1, x, pitch_deg)


def _inside(mesh, upright, view: View, extent: float, row: float, x: float, pitch_deg: float) -> Placement:
    """Placed on a row, moved along it and made smaller until the picture's border cuts nothing off."""
    edge = MARGIN * view.width
    for _ in range(MOST_FITS):
        placed = _on_row(mesh, upright, view, extent, row, x, pitch_deg)
        pixels = view.pixels(placed.mesh.positions)
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        share = min((view.width - 2 * edge) / (right - left), (row - edge) / (bottom - top), 1.0)
        outside = max(edge - left, 0.0) - max(right - (view.width - edge), 0.0)
        if share > 0.999 and abs(outside) < 0.5:
            break
        extent *= max(share, LEAST_STEP)
        x += outside if share > LEAST_STEP else (view.width / 2 - x)
    return placed


def _on_row(mesh, upright, view: View, extent: float, row: float, x: float, pitch_deg: float) -> Placement:
    """Placed so that its lowest visible point is on a row: its foot is a little further up the picture."""
    foot_row = row
    for _ in range(6):
        placed = _standing(mesh, upright, view.on_ground(x, foot_row), extent, pitch_deg)
        lowest = view.pixels(placed.mesh.positions)[:, 1].max()
        horizon = view.height / 2 - view.focal * np.tan(np.radians(pitch_deg))
        foot_row = max(foot_row + (row - lowest), horizon + 0.02 * view.height)
    return placed


def _standing(
    mesh: Mesh, upright: np.ndarray, foot: np.ndarray, extent: float, pitch_deg: float
) -> Placement:
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    scale = extent / float((high - low).max())
    bottom = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    positions = (mesh.positions - bottom) * scale @ upright.T + foot
    placed = Mesh(
        positions=positions, faces=mesh.faces, normals=(mesh.normals @ upright.T).astype(np.float32)
    )
    return Placement(mesh=placed, foot=foot, radius=scale, pitch_deg=pitch_deg)
