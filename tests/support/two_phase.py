"""The map that tells a roll, a mirror and a flip from each other: (0.5 + 0.5 cos 2 pi u, 0.5 + 0.5 sin 2 pi u, v).

u and v are those of our own frame, so that a program which shows the colour (r, g, b) somewhere
shows where in our map it looked. A mirrored map passes tests with an emitter on an axis; not this one.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import uv_to_direction


def two_phase(height: int = 64) -> np.ndarray:
    """[H, 2H, 3] float32 in [0, 1]."""
    u = (np.arange(2 * height) + 0.5) / (2 * height)
    v = (np.arange(height) + 0.5) / height
    u, v = np.meshgrid(u, v)
    return np.stack([0.5 + 0.5 * np.cos(2 * np.pi * u), 0.5 + 0.5 * np.sin(2 * np.pi * u), v], axis=-1).astype(
        np.float32
    )


def seen_uv(rgb: np.ndarray) -> np.ndarray:
    """Colours [..., 3] to where in our map they were read, [..., 2]."""
    u = np.arctan2(rgb[..., 1] - 0.5, rgb[..., 0] - 0.5) / (2 * np.pi) % 1.0
    return np.stack([u, rgb[..., 2]], axis=-1)


def seen_direction(rgb: np.ndarray) -> np.ndarray:
    """Colours [..., 3] to directions [..., 3] in our axes."""
    return uv_to_direction(seen_uv(np.asarray(rgb, dtype=np.float64)))


def probe_directions(count: int = 40) -> np.ndarray:
    """Unit directions [N, 3] all over the sphere, off the axes and off the poles' pixels."""
    i = np.arange(count) + 0.5
    y = 0.97 * (1 - 2 * i / count)
    phi = np.pi * (1 + 5**0.5) * i + 0.3
    radius = np.sqrt(1 - y * y)
    return np.stack([radius * np.sin(phi), y, radius * np.cos(phi)], axis=-1)


def assert_same_way_round(rgb: np.ndarray, directions: np.ndarray, degrees: float) -> None:
    """What was seen along directions [N, 3] (ours) is what our map has there, within an angle."""
    cosine = np.sum(seen_direction(rgb) * directions, axis=-1)
    angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    worst = int(np.argmax(angles))
    assert angles[worst] < degrees, (
        f"along {np.round(directions[worst], 3)} the picture of {np.round(seen_direction(rgb[worst]), 3)}"
    )
