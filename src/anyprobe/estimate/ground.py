"""The ground under the object: the camera's pitch and roll over it, and the point where the object touches it.

A pitch that is not given is guessed from how such photos are usually taken, with the guess's error, until
refine.with_estimated_ground puts what the network sees in its place.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol

import numpy as np

from anyprobe.core import Float
from anyprobe.core.camera import PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.core.frames import rotation_x, rotation_z
from anyprobe.errors import InputError
from anyprobe.masks.check import object_box

GIVEN, NOTED, ESTIMATED, GUESSED = "given", "exif", "estimated", "guessed"
KNOWN = (GIVEN, NOTED)
"""Sources of a ground that is passed to the network."""
_GROUND = contract("ground")
USUAL_PITCH_DEG: float = _GROUND["usual_pitch_deg"]
USUAL_ERROR_DEG: float = _GROUND["usual_error_deg"]
"""Mean error [degrees] of the guessed pitch of photos of objects on tables and floors, usually 5 to 50 downwards."""
USUAL_ROLL_DEG = 0.0
GIVEN_ERROR_DEG: float = _GROUND["given_error_deg"]
"""Error [degrees] of a pitch that was measured or set by eye."""
SPREAD = float(np.sqrt(np.pi / 2))
"""Standard deviation of a normal distribution over its mean absolute error."""
LEAST_SLOPE_DEG: float = _GROUND["least_slope_deg"]
"""Smallest angle [degrees] below the horizon at which the ground at the object's base is seen."""
LEAST_CONTACT: float = _GROUND["least_contact"]
CONTACT_BAND: float = _GROUND["contact_band"]
"""Width of mask rows, in the object's widths, below which it does not stand on them; and height of the mask's lower
border, in the object's heights."""


def pitch_words(pitch_deg: float, unit: str = " degrees", error_deg: float | None = None) -> str:
    """Return "20 degrees down" of a pitch downwards, "5 degrees up" of a negative one, "20 ± 8 degrees down"."""
    error = "" if error_deg is None else f" ± {error_deg:.0f}"
    return f"{abs(pitch_deg):.0f}{error}{unit} {'up' if round(pitch_deg) < 0 else 'down'}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Ground:
    """A horizontal plane under the object, in the camera's frame.

    Attributes:
        pitch_deg: camera pitch downwards: 0 level, 90 straight down.
        pitch_error_deg: its standard deviation.
        roll_deg: camera roll to the left about its axis, so that the picture turns to the right.
        contact: x, y [px] where the object touches the ground.
        source: "given", "exif" (noted by the camera), "estimated" from the photo by a network, or "guessed".
        is_doubtful: whether the object's place in the photo contradicts the usual guess.
    """

    pitch_deg: float
    pitch_error_deg: float
    roll_deg: float
    contact: tuple[float, float]
    source: str
    is_doubtful: bool = False

    @property
    def up(self) -> np.ndarray:
        """Unit vector [3] away from the ground, in the camera's frame."""
        return up_of(self.pitch_deg, self.roll_deg)

    @property
    def level_from_camera(self) -> np.ndarray:
        """Rotation [3, 3] from the camera's frame to one whose +Y is up; the camera's azimuth is kept."""
        return rotation_x(-np.radians(self.pitch_deg)) @ rotation_z(np.radians(self.roll_deg))

    def said_level(self) -> str:
        """Describe how a map was levelled, as one line for a sidecar."""
        return (
            f"+Y is up: turned by the camera's pitch of {self.pitch_deg:z.1f} and roll of {self.roll_deg:z.1f} "
            f"degrees, {self.source}, give or take {self.pitch_error_deg:.0f}"
        )

    @staticmethod
    def of(info: dict[str, Any] | None) -> Ground | None:
        """Restore the ground from `info`; None for None.

        Raises:
            KeyError, TypeError: other fields, or what should be numbers is none.
        """
        if info is None:
            return None
        numbers = (info["pitch_deg"], info["pitch_error_deg"], info["roll_deg"], *info["contact"])
        if not all(isinstance(one, int | float) for one in numbers):
            raise TypeError(f"expected numbers, got {numbers}")
        known = {name: value for name, value in info.items() if name != "long_fov_deg"}  # of older files
        return Ground(**{**known, "contact": tuple(info["contact"])})

    @property
    def is_known(self) -> bool:
        """Whether it was given or noted, not estimated from the photo's pixels."""
        return self.source in KNOWN

    def info(self) -> dict[str, Any]:
        """Return the fields of a sidecar, rounded."""
        angles = {name: round(getattr(self, name), 2) for name in ("pitch_deg", "pitch_error_deg", "roll_deg")}
        return {**asdict(self), **angles, "contact": [round(one, 1) for one in self.contact]}


def up_of(pitch_deg: float, roll_deg: float = 0.0) -> np.ndarray:
    """Return the world's +Y [3] in the frame of a camera with this pitch and roll."""
    pitch, roll = np.radians(pitch_deg), np.radians(roll_deg)
    return np.array([np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll), np.sin(pitch)])


def ground_by_posture(ground: Ground, posture: Float[np.ndarray, " 3"]) -> Ground:
    """Return a guessed ground with the pitch and roll estimated by a network; posture: see light_graph.Said."""
    pitch_deg, roll_deg, error_deg = (float(one) for one in posture)
    given = replace(ground, pitch_deg=pitch_deg, pitch_error_deg=error_deg * SPREAD, roll_deg=roll_deg)
    return replace(given, source=ESTIMATED, is_doubtful=False)


def levelled(
    ground: Ground | None, map_from_camera: Float[np.ndarray, "3 3"], *, is_wanted: bool
) -> tuple[np.ndarray | None, dict[str, str]]:
    """Return the rotation [3, 3] that levels an estimate's map, None for none, and the origin's entry for an export.

    The entry says how the exported map lies; it is empty for a map that was turned otherwise. The ground may be a
    sidecar's, with rounded angles.
    """
    if np.allclose(map_from_camera, np.eye(3)):
        if is_wanted and ground is not None:
            return ground.level_from_camera, {"level": ground.said_level()}
        reason = "; the camera's pitch is not known" if ground is None else ""
        return None, {"level": f"in the camera's frame: +Y is up in the photo, not in the place{reason}"}
    is_level = ground is not None and np.allclose(map_from_camera, ground.level_from_camera, atol=1e-3)
    return None, {"level": ground.said_level()} if ground is not None and is_level else {}


class Framed(Protocol):
    """Evidence for the ground: mask [H, W], field of view of the longer side, pitch where given."""

    @property
    def mask(self) -> np.ndarray: ...
    @property
    def long_fov_deg(self) -> float: ...
    @property
    def pitch_deg(self) -> float | None: ...


def estimate_ground(photo: Framed, *, pitch_deg: float | None = None, roll_deg: float | None = None) -> Ground:
    """Return the ground of a photo whose object is marked.

    Args:
        pitch_deg, roll_deg: where known; without pitch_deg, the photo's own pitch is used.
    Raises:
        InputError: a pitch or roll that is impossible for a camera over a ground.
    """
    x, row = contact_of(photo.mask)
    pitch_deg = photo.pitch_deg if pitch_deg is None else pitch_deg
    if roll_deg is not None and not -60 <= roll_deg <= 60:
        text = f"expected -60 to 60 degrees, got {roll_deg:g}; turn the photo upright first"
        raise InputError(text, subject="roll_deg")
    roll = USUAL_ROLL_DEG if roll_deg is None else float(roll_deg)
    if pitch_deg is not None:
        if not -90 <= pitch_deg <= 90:
            text = f"expected -90 to 90 degrees downwards, got {pitch_deg:g}; give another"
            raise InputError(text, subject="pitch_deg")
        return Ground(
            pitch_deg=float(pitch_deg), pitch_error_deg=GIVEN_ERROR_DEG, roll_deg=roll, contact=(x, row), source=GIVEN
        )
    height, width = photo.mask.shape
    focal = PinholeCamera.of_fov(width, height, photo.long_fov_deg).focal
    below_axis = float(np.degrees(np.arctan2(row - height / 2, focal)))
    least_deg = LEAST_SLOPE_DEG - below_axis
    return Ground(
        pitch_deg=max(USUAL_PITCH_DEG, least_deg),
        is_doubtful=least_deg > USUAL_PITCH_DEG,
        pitch_error_deg=USUAL_ERROR_DEG,
        roll_deg=roll,
        contact=(x, row),
        source=GUESSED,
    )


def contact_of(mask: np.ndarray) -> tuple[float, int]:
    """Return pixel x, y where an object [H, W] touches the ground: the middle of its mask's lower border, and its
    row."""
    x0, y0, x1, y1 = object_box(mask)
    inside = mask[y0:y1, x0:x1] > 0.5
    wide = np.flatnonzero(inside.sum(axis=1) >= LEAST_CONTACT * (x1 - x0))
    row = int(wide[-1]) + 1 if len(wide) else 1
    columns = np.nonzero(inside[max(int(row - CONTACT_BAND * (y1 - y0)), 0) : row])[1]
    return (x0 + float(columns.mean()) + 0.5 if len(columns) else (x0 + x1) / 2), y0 + row
