"""Mirror balls drawn under known maps, for the estimate that recognises them by themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.frames import reflect, rotation_y
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.light.environment import integral, reduced
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import read_radiance
from anyprobe_train.evaluate.metrics import direction_error_deg

FOV_DEG, SHAPE = 60.0, (480, 640)
"""Field of view of the longer side, which no photo says, and rows and columns."""
MAP_ROWS = 256
REFLECTS = 0.85
"""Of a ball, all colours alike."""
CLIPPED, WHITE = 0.01, 0.97
"""Share of the ball that is clipped, as one exposes for mirror balls, and the display value that counts so."""
LEAST_SHARE = 0.1
"""Of its map's power, of a dominant light that can be asked for."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Ball:
    """A photo [H, W, 3] uint8 of a ball, its mask [H, W], and the direction [3] of the map's dominant light.

    clipped_deg: angle [degrees] from it to the dominant light of the whole map, clipped as the photo is.
    """

    name: str
    photo: np.ndarray
    mask: np.ndarray
    towards: np.ndarray
    clipped_deg: float


def balls_under(folder: Path) -> Iterator[Ball]:
    """Yield one ball under each map of a folder that has a dominant light, turned at random about the vertical."""
    for number, path in enumerate(sorted((*folder.glob("*.exr"), *folder.glob("*.hdr")))):
        random = np.random.default_rng(number)
        turn = rotation_y(random.uniform(0, 2 * np.pi))
        radiance = reduced(read_radiance(path), MAP_ROWS)
        main = find_dominant_light(radiance)
        if luminance(main.irradiance) < LEAST_SHARE * luminance(integral(radiance)):
            continue
        photo, mask, gain = draw_ball(radiance, turn, random)
        clipped = find_dominant_light(np.minimum(gain * REFLECTS * radiance, 1.0))
        yield Ball(
            name=path.stem,
            photo=photo,
            mask=mask,
            towards=turn.T @ main.direction,
            clipped_deg=direction_error_deg(clipped.direction, main.direction),
        )


def draw_ball(
    radiance: np.ndarray, turn: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return photo and mask of a ball before a map [H, 2H, 3], and the photo's gain.

    turn: [3, 3] from the camera's frame to the map's.
    """
    height, width = SHAPE
    focal = width / 2 / np.tan(np.radians(FOV_DEG) / 2)
    y, x = np.mgrid[:height, :width] + 0.5
    d = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    axis = np.array([random.uniform(-0.15, 0.15), random.uniform(-0.12, 0.05), -1.0])
    axis, radius = axis / np.linalg.norm(axis), random.uniform(0.2, 0.34)
    along = d @ axis
    inside = along**2 - 1 + radius**2
    on = inside > 0
    n = (((along - np.sqrt(np.maximum(inside, 0)))[..., None] * d - axis) / radius)[on]
    picture = bilinear(radiance, direction_to_uv(d @ turn.T))
    picture[on] = REFLECTS * bilinear(radiance, direction_to_uv(reflect(-d[on], n) @ turn.T))
    brightest = float(np.quantile(picture[on].max(axis=-1), 1 - CLIPPED))
    gain = float(inverse_response(np.array([WHITE]))[0]) / max(brightest, 1e-9)
    return to_bytes(response(gain * picture)), on.astype(np.float32), gain


def ball_angle(ball: Ball, estimator: Estimator) -> tuple[bool, float]:
    """Return whether a ball was recognised, and the angle [degrees] from its estimated dominant light to the true."""
    light = estimator.from_photo(load_photo(ball.photo, mask=ball.mask))
    known = bool(light.info.get("hints", {}).get("measured"))
    return known, direction_error_deg(light.dominant_light().direction, ball.towards)
