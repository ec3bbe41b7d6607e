"""Placement of a virtual object on the real one's ground: of many places and sizes, the one of the greatest score.

    score = size x likelihood of the surface x exp(-gap / size of the real object) x look

The likelihood is that of the colours from the real object's foot to the virtual one's, over the greatest, under one
Gaussian of ln radiance below the former. The look is half in the real object's shadow, and less where spheres would be
long. Places behind the real object, or that cover part of it, have none, as they
seldom seem to be on its ground. Where the virtual object would seem to float or be far off, it is refused.

The real object's form is guessed from its mask: an upright body of elliptic sections, whose back is as its front.
"""

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.camera import MOST_STRETCH
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
SEEN_UNDER = 0.2
"""Reach around the contact point, in the real object's widths, whose colours are the surface's."""
FLOOR = 0.005
"""Radiance added before its logarithm."""
SHADE, TINT = 0.8, 0.08
"""Standard deviations of ln radiance on one surface, all channels together and each by itself."""
COLUMNS, ROWS, SIZES, SMALLEST = 48, np.linspace(0, 1, 5), 12, 0.04
"""Number of columns; rows, from the real object's (0) to the border (1); number of sizes, and the smallest, in the real
object's height."""
LEAST = 0.3
"""Smallest score, but for size, of a place that is taken: of 41 photos rendered of training assets one is then refused,
and in three the object stands on something else."""

_MARGIN, GAP = 0.02, 0.15
"""Margins kept free: at the photo's border, in its widths; and between the two objects, in the virtual one's."""

FLAT = 0.6
"""Smallest height of a real object, in its widths; a flatter one counts as this high."""

LEAST_HEIGHT = 1e-3
"""Smallest height of a virtual object, in its widths: sizes are given by height."""
LEAST_RISE = 1e-3
"""Smallest sine of a light above the ground, and of a direction below it that meets the ground."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Placement:
    """A mesh placed on the ground.

    mesh: in the camera's frame. foot: [3] point of the ground below its middle. radius: of the
    smallest sphere around it. pitch_deg: camera's, downwards. share: its size over the requested one.
    is_in_front: whether it stands in columns of the photo that show the real object, at its height or lower, and not
    where the caller chose.
    """

    mesh: Mesh
    foot: np.ndarray
    radius: float
    pitch_deg: float
    share: float = 1.0
    is_in_front: bool = False


def place_beside(
    mesh: Mesh,
    photo: Photo,
    view: View,
    pitch_deg: float,
    size: float = 0.5,
    at: tuple[float, float] | None = None,
    turn_deg: float = 0.0,
    toward_light: np.ndarray | None = None,
) -> Placement:
    """Stand a mesh (+Y up) on the ground of a photo.

    Args:
        size: its height over that of the real object, which stands on its mask's lower border.
        at: x, y of its foot [px], where it keeps its full size; by default it stands where its score is greatest.
        turn_deg: about its vertical axis. toward_light: unit direction of the dominant light, if known.
    Raises:
        InputError: no ground is visible at that pixel, every place has less than LEAST, or the mesh is flat.
    """
    check_height(mesh)
    rolled = rotation_z(-np.arctan2(view.up[0], view.up[1]))
    upright = rolled @ rotation_x(np.radians(pitch_deg)) @ rotation_y(np.radians(turn_deg))
    unit = _unit_high(mesh)
    left, top, right, bottom = object_box(photo.mask)
    depth = -view.on_ground(*contact_of(photo.mask))[2]
    height = max(bottom - top, FLAT * (right - left)) / view.focal * depth * size
    if at is not None:
        foot = view.on_ground(*at)
        if not np.isfinite(foot).all():
            text = f"{at[0]:g},{at[1]:g} is above the horizon; point lower, or pitch the camera down"
            raise InputError(text, subject="at")
        return _standing(unit, upright, foot, height, pitch_deg)
    spots = Spots(photo, view, _outermost(unit.positions @ upright.T * height), size, toward_light)
    best = int(np.argmax(np.where(spots.certain < LEAST, 0.0, spots.certain * spots.share * spots.look)))
    if spots.certain[best] < LEAST:
        found = "no room for it" if spots.near.max() < LEAST else "another surface there"
        text = f"expected the surface under the object to go on beside it, got {found}; point to where it shall stand"
        raise InputError(text, subject="at")
    share = float(spots.share[best])
    placed = _standing(unit, upright, spots.foot[best], height * share, pitch_deg)
    pixels = np.maximum(view.pixels(placed.mesh.positions), 0).astype(int)
    below = photo.mask[min(pixels[:, 1].min(), bottom - 1) :, pixels[:, 0].min() : pixels[:, 0].max() + 1]
    return replace(placed, share=share, is_in_front=bool((below > 0.5).any()))


class RealSurface:
    """The surface under the real object of a photo, in cells."""

    def __init__(self, photo: Photo, contact: tuple[float, float]) -> None:
        """Compare the photo's colours with those below the pixel x, y where the object touches it."""
        height, width = photo.mask.shape
        self.cell = max(height, width) / CELLS
        size = max(1, round(width / self.cell)), max(1, round(height / self.cell))
        seen = np.log(inverse_response(resample(photo.rgb, size)) + FLOOR)
        object_share = resample(photo.mask[..., None], size)[..., 0]
        hidden = object_share if photo.hidden is None else np.maximum(object_share, resample(photo.hidden * 1.0, size))
        known, covered = hidden < 0.02, object_share > 0.02
        left, _, right, _ = object_box(photo.mask)
        reach = max(SEEN_UNDER * (right - left) / self.cell, 2.0)
        row, column = np.mgrid[: size[1], : size[0]] + 0.5
        away = np.hypot(column - contact[0] / self.cell, row - contact[1] / self.cell)
        under = seen[(away < reach) & (row > contact[1] / self.cell) & known]
        known &= len(under) > 1
        off, spread = seen, SHADE**2 * np.ones((3, 3)) + TINT**2 * np.eye(3)
        if len(under) > 1:
            off, spread = seen - np.median(under, axis=0), spread + np.cov(under.T)
        unlike = np.einsum("...i,ij,...j", off, np.linalg.inv(spread), off)
        parts = np.stack([unlike * known, known, covered], axis=-1)
        self._sums = np.pad(parts, ((1, 0), (1, 0), (0, 0))).cumsum(axis=0).cumsum(axis=1)

    def inside(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how likely the colours between pixels low and high [N, 2] are, and whether the object is there."""
        sides = np.array(self._sums.shape[1::-1]) - 1
        x0, y0 = np.clip(np.floor(low / self.cell), 0, sides).astype(int).T
        x1, y1 = np.clip(np.ceil(high / self.cell), 0, sides).astype(int).T
        sums = self._sums[y1, x1] - self._sums[y0, x1] - self._sums[y1, x0] + self._sums[y0, x0]
        unlike, known, covered = sums.T
        return np.exp(-0.5 * unlike / np.maximum(known, 1)), covered > 0


class Spots:
    """Places of an object: foot [N, 3], share, near, certain (the score but for size and look) and look, [N]."""

    def __init__(
        self, photo: Photo, view: View, points: np.ndarray, size: float, toward_light: np.ndarray | None = None
    ) -> None:
        """Score them all; points: [P, 3] of the whole object from its foot. size: its height, in the real one's."""
        edge, sides = _MARGIN * view.width, np.array([view.width, view.height])
        x, lowest = contact_of(photo.mask)
        row = max(min(lowest, view.height - edge), view.farthest_row)
        columns = (np.arange(COLUMNS) + 0.5) / COLUMNS * view.width
        shares = np.geomspace(1.0, min(SMALLEST / size, 1.0), SIZES)
        self.share, toward, column = (one.ravel() for one in np.meshgrid(shares, ROWS, columns, indexing="ij"))
        rows = row + toward * max(view.height - edge - row, 0.0)
        foot_row = rows
        for _ in range(3):  # its lowest pixel is on the row
            self.foot = view.on_ground(column, np.maximum(foot_row, view.farthest_row))
            pixels = view.pixels(self.foot[:, None] + self.share[:, None, None] * points)
            low, high = pixels.min(axis=1), pixels.max(axis=1)
            foot_row = foot_row + rows - high[:, 1]
        wide = np.stack([high[:, 0] - low[:, 0], np.zeros(len(low))], axis=-1)
        surface = RealSurface(photo, (x, row))
        _, covers = surface.inside(low - GAP * wide, high + GAP * wide)
        free = ((low > edge) & (high < sides - edge + 0.5)).all(axis=-1) & ~covers
        _, top, _, bottom = object_box(photo.mask)
        lower = photo.mask.copy()
        lower[: (top + bottom) // 2] = 0  # that may hang over
        left, _, right, _ = object_box(lower)
        quarter = (right - left) / 4  # what carries the real object is at least half as wide
        near, far = np.minimum(low, x - quarter), np.maximum(high, x + quarter)
        near[:, 1], far[:, 1] = row - wide[:, 0] / 4, rows + wide[:, 0] / 4
        likelihood, _ = surface.inside(near, far)
        across = np.maximum(np.maximum(left - high[:, 0], low[:, 0] - right), 0.0)
        real = max(bottom - top, FLAT * (right - left))
        contact = view.on_ground(x, row)
        along = np.linalg.norm(view.on_ground(0 * rows + x, rows) - contact, axis=-1)
        self.near = free * np.exp(-np.hypot(across, along * view.focal / -contact[2]) / real)
        self.certain = likelihood * self.near
        long = np.linalg.norm(view.rays(*(low + high).T / 2), axis=-1)
        self.look = np.minimum((MOST_STRETCH - 1.0) / np.maximum(long - 1.0, 1e-6), 1.0)
        if toward_light is not None:
            half = self.share * np.ptp(points @ view.up) / 2
            real_size = np.array([right - left, bottom - top]) / view.focal * -contact[2]
            self.look *= 1.0 - shaded(self.foot - contact, half, real_size, view.up, toward_light) / 2


def shaded(
    foot: np.ndarray, half: np.ndarray, real_size: np.ndarray, up: np.ndarray, toward_light: np.ndarray
) -> np.ndarray:
    """Return how much of balls of radii half [N] that stand on foot [N, 3] is in the shadow of an upright cylinder of
    width and height real_size, which touches the ground at the origin."""
    sine = max(float(toward_light @ up), LEAST_RISE)
    along = toward_light - (toward_light @ up) * up
    away = np.array([0.0, 0.0, -1.0]) + up[2] * up
    axis = away / max(float(np.linalg.norm(away)), LEAST_RISE) * real_size[0] / 2 - foot
    reach = axis @ along / max(float(along @ along), LEAST_RISE)  # of the light's way, to where it is nearest
    across = np.linalg.norm(axis - reach[:, None] * along - (axis @ up)[:, None] * up, axis=-1)
    height = half + reach * sine
    parts = [(of + half - off) / (2 * half) for of, off in zip(real_size / [2, 1], (across, height), strict=True)]
    return np.where(reach > 0, np.prod(np.clip(parts, 0.0, 1.0), axis=0), 0.0)


def _outermost(points: np.ndarray) -> np.ndarray:
    """Return those points [P, 3] of an object that are farthest in some direction across the camera's axis."""
    angle = np.linspace(0, 2 * np.pi, 24)
    ways = [np.stack([np.cos(angle), np.sin(angle), 0 * angle + tilt]) for tilt in (-0.3, 0.3)]
    return points[np.unique((points @ np.concatenate(ways, axis=1)).argmax(axis=0))]


def check_foot(at: tuple[float, float] | None, height: int, width: int) -> None:
    """Raise InputError if the pixel x, y is outside a photo of this size."""
    if at is not None and not (0 <= at[0] <= width and 0 <= at[1] <= height):
        text = f"expected a pixel of {width} x {height}, got {at[0]:g},{at[1]:g}; choose another"
        raise InputError(text, subject="at")


def check_height(mesh: Mesh) -> None:
    """Raise InvalidMesh if a mesh lies flat: sizes are relative to its height."""
    width, height, depth = np.ptp(mesh.positions, axis=0)
    if height < LEAST_HEIGHT * max(width, depth):
        text = "expected a mesh with a height, got one that lies flat; turn it so that +Y is up"
        raise InvalidMesh(text, subject="mesh")


def _unit_high(mesh: Mesh) -> Mesh:
    """Scale a mesh to height one, standing on the origin."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    bottom = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(mesh, positions=(mesh.positions - bottom) / float(high[1] - low[1]))


def _standing(unit: Mesh, upright: np.ndarray, foot: np.ndarray, height: float, pitch_deg: float) -> Placement:
    radius = height * float(np.linalg.norm(unit.positions - np.array([0.0, 0.5, 0.0]), axis=1).max())
    positions = unit.positions @ upright.T * height + foot
    placed = Mesh(positions=positions, faces=unit.faces, normals=(unit.normals @ upright.T).astype(np.float32))
    return Placement(mesh=placed, foot=foot, radius=radius, pitch_deg=pitch_deg)


BODY_ROWS, SECTORS = 32, 32
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
    # the upper outline is seen past the middle: of an ellipsoid with half axes a and b, at sqrt(a^2 + b^2 tan^2)
    upper = np.maximum((middle - middle[len(middle) // 2]) @ view.up, 0.0)
    beyond = DEPTH * half.max() / np.linalg.norm(away)  # the camera's height is one
    lower = 1.0 - np.sqrt(max(1.0 - (beyond / max(upper.max(), 1e-9)) ** 2, 0.0))
    middle = middle - lower * upper[:, None] * view.up
    if (flat := _flattened(spot, middle, half, view.up, right, toward)) is None:
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
