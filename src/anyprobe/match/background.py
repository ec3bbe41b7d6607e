"""The background of a photo compared with maps at places, in brightness and hue as the object is; exposure and white
balance are free. A place is a yaw about the map's vertical and a pitch of the camera below its horizon.

    cost = BEHIND_WEIGHT (ln(mean square of brightness + BEHIND_FLOOR) + ln(mean square of hue + BEHIND_FLOOR / 10))
"""

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.resample import between
from anyprobe.light.environment import reduced

YAWS = 32
"""Number of yaws that a search tries, evenly spaced."""


def map_from_camera_at(yaw: float, pitch_deg: float) -> np.ndarray:
    """Return the rotation [3, 3] of a place."""
    return rotation_y(yaw) @ rotation_x(-np.radians(pitch_deg))


def nearest_pixels(d: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return row and column, in a map of this many rows, of each direction [P, 3]."""
    uv = direction_to_uv(d)
    return np.clip((uv[..., 1] * rows).astype(int), 0, rows - 1), (uv[..., 0] * 2 * rows).astype(int) % (2 * rows)


def seen_at_yaws(maps: np.ndarray, at: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Look up maps [N, H, 2H, C] at P pixels for each yaw: [N * YAWS, P, C]; a yaw shifts them to the left."""
    columns = maps.shape[2]
    moved = (at[1] - columns // YAWS * np.arange(YAWS)[:, None]) % columns
    return maps[:, at[0], moved].reshape(-1, len(at[0]), maps.shape[-1])


def seen_along(maps: np.ndarray, index: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Interpolate M of the maps [N, H, 2H, C] at M x P directions: [M, P, C]."""
    (rows, columns), uv = maps.shape[1:3], direction_to_uv(d)
    row = np.clip(uv[..., 1].astype(np.float64) * rows - 0.5, 0.0, rows - 1.001) + rows * index[:, None]
    stacked = maps.reshape(-1, columns, maps.shape[-1])
    return between(stacked, uv[..., 0] * columns - 0.5, row, wraps=True).astype(maps.dtype)


BEHIND_WEIGHT, BEHIND_FLOOR = 2.0, 0.02
"""Natural logarithms of probability a unit of ln mean square, as match.likeness.NATS; and the floor above."""
MOST_PIXELS, LEAST_PIXELS = 128, 4
"""Largest number of background pixels that are compared, and the smallest that suffices."""
COVERED = 0.5
"""Smallest cover of a pixel that counts as known."""
CLIPPED_WEIGHT = 0.3
"""Weight of a clipped pixel, which is only a lower bound."""
LEAST_SEEN = 0.1
"""Smallest unclipped share that determines a level."""
FAINT_SEEN = 0.05
"""Share of the mean that is added before logarithms, against noise."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Background:
    """Radiance of a photo beside its object.

    Attributes:
        d: [B, 3] unit directions in the camera's frame.
        radiance: [B, 3], linear.
        clipped: [B], whether the pixel is clipped.
        share: [B], weights that sum to 1.
    """

    d: np.ndarray
    radiance: np.ndarray
    clipped: np.ndarray
    share: np.ndarray

    def at_yaws(self, maps: np.ndarray, pitch_deg: float) -> np.ndarray:
        """Return the cost of maps [N, H, 2H, 3] at a camera pitch and every yaw: [N, YAWS]."""
        level = self.d @ map_from_camera_at(0.0, pitch_deg).T
        return self._cost(seen_at_yaws(maps, nearest_pixels(level, maps.shape[1]))).reshape(len(maps), YAWS)

    def at_turns(self, maps: np.ndarray, index: np.ndarray, map_from_camera: np.ndarray) -> np.ndarray:
        """Return the cost of the maps of index [M] at rotations [M, 3, 3]: [M]."""
        return self._cost(seen_along(maps, index, self.d @ map_from_camera.transpose(0, 2, 1)))

    def level_of(self, light: np.ndarray, map_from_camera: np.ndarray) -> float | None:
        """Return the background's level over that of a map [H, 2H, 3] at a rotation; None where it is clipped."""
        share = self.share * ~self.clipped
        if share.sum() < LEAST_SEEN:
            return None
        drawn = bilinear(light, direction_to_uv(self.d @ map_from_camera.T))
        own, theirs = (np.log(luminance(values) + 1e-3) for values in (self.radiance, drawn))
        return float(np.exp(share @ (own - theirs) / share.sum()))

    def _cost(self, drawn: np.ndarray) -> np.ndarray:
        """Return the cost [M] of radiance [M, B, 3] along the directions."""
        share = self.share
        rest = np.log(drawn + FAINT_SEEN * np.einsum("mpc,p->mc", drawn, share)[:, None] + 1e-9)
        rest -= np.log(self.radiance + FAINT_SEEN * (share @ self.radiance) + 1e-9)
        rest -= np.einsum("mpc,p->mc", rest, share)[:, None]
        rest[:, self.clipped] = np.minimum(rest[:, self.clipped], 0.0)
        brightness, hue = mean_squares(rest, share)
        return BEHIND_WEIGHT * (np.log(brightness + BEHIND_FLOOR) + np.log(hue + BEHIND_FLOOR / 10))


def background_of(
    radiance: np.ndarray, clipped: np.ndarray, cover: np.ndarray, camera_from_map: np.ndarray, rows: int
) -> Background | None:
    """Sample the known part of a map; None where that is too small.

    Args:
        radiance: [H, 2H, 3], clipped: [H, 2H, 3] bool, cover: [H, 2H, 1] in [0, 1].
        camera_from_map: [3, 3].
        rows: of the maps it is compared with.
    """
    small = reduced(np.concatenate([radiance * cover, clipped * cover, cover], axis=-1).astype(np.float32), rows)
    at = np.nonzero(small[..., 6] > COVERED)
    if len(at[0]) < LEAST_PIXELS:
        return None
    chosen = np.random.default_rng(0).permutation(len(at[0]))[:MOST_PIXELS]
    row, column = (axis[chosen] for axis in at)
    known = small[row, column]
    is_clipped = known[:, 3:6].max(axis=-1) > 0.5 * known[:, 6]
    share = known[:, 6] * pixel_solid_angles(rows)[row, 0] * np.where(is_clipped, CLIPPED_WEIGHT, 1.0)
    return Background(
        d=pixel_directions(rows)[row, column] @ camera_from_map.T,
        radiance=known[:, :3] / known[:, 6:],
        clipped=is_clipped,
        share=(share / share.sum()).astype(np.float32),
    )


def mean_squares(rest: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean squared differences of logarithms [M, P, 3]: brightness [M], hue [M]; weights [P] sum to 1."""
    bright = rest.mean(axis=-1)
    whole = np.einsum("mpc,mpc,p->m", rest, rest, share)
    brightness = np.einsum("mp,mp,p->m", bright, bright, share)
    return brightness, np.maximum(whole - 3 * brightness, 0.0)
