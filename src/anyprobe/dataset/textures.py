"""Patterns the project makes itself: what tables, walls and cloths look like, [S, S, 3] reflectances."""

from __future__ import annotations

import numpy as np

from anyprobe.dataset.sky import tint


def smooth_noise(rng: np.random.Generator, size: int, cells: float, aspect: float = 1.0) -> np.ndarray:
    """Gaussian noise [size, size] of unit deviation, band-limited to about `cells` waves a side.

    aspect: above 1 the grain is so much longer across than down.
    """
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(frequency[None, :] * aspect, frequency[:, None])
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) * np.exp(-0.5 * (radius / cells) ** 2)
    values = np.fft.ifft2(spectrum).real
    return (values - values.mean()) / max(values.std(), 1e-9)


def rough_noise(rng: np.random.Generator, size: int, slope: float, aspect: float = 1.0) -> np.ndarray:
    """Noise of all scales: its amplitude falls with frequency to the power -slope."""
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(frequency[None, :] * aspect, frequency[:, None])
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) / np.maximum(radius, 1.0) ** slope
    values = np.fft.ifft2(spectrum).real
    return (values - values.mean()) / max(values.std(), 1e-9)


def _stripes(rng: np.random.Generator, size: int, bend: float) -> np.ndarray:
    y, x = np.mgrid[0:size, 0:size] / size
    angle = rng.uniform(0, np.pi)
    along = x * np.cos(angle) + y * np.sin(angle) + bend * smooth_noise(rng, size, 2.0)
    return np.sin(2 * np.pi * np.exp(rng.uniform(np.log(3), np.log(25))) * along)


def _checks(rng: np.random.Generator, size: int) -> np.ndarray:
    y, x = np.mgrid[0:size, 0:size] / size
    across, down = np.exp(rng.uniform(np.log(2), np.log(14), size=2))
    if rng.random() < 0.5:
        return np.where((np.floor(x * across) + np.floor(y * down)) % 2 > 0, 1.0, -1.0)
    offset = 0.5 * (np.floor(y * down) % 2)  # bricks and planks
    joint = np.minimum((x * across + offset) % 1 / across, (y * down) % 1 / down) < rng.uniform(0.004, 0.02)
    tone = rng.standard_normal((32, 32))
    return tone[np.int64(y * down) % 32, np.int64(x * across + offset) % 32] - 2.5 * joint


def _cells(rng: np.random.Generator, size: int) -> np.ndarray:
    """Voronoi cells: pebbles, tiles, terrazzo."""
    y, x = np.mgrid[0:size, 0:size] / size
    points = rng.random((int(rng.integers(8, 60)), 2))
    distance = (x[..., None] - points[:, 0]) ** 2 + (y[..., None] - points[:, 1]) ** 2
    return rng.standard_normal(len(points))[distance.argmin(axis=-1)]


def draw_texture(rng: np.random.Generator, size: int = 128) -> np.ndarray:
    """One pattern of a random family in random colours, [size, size, 3] in [0.02, 0.95]."""
    kind = rng.integers(7)
    if kind == 0:
        pattern = rough_noise(rng, size, rng.uniform(0.7, 1.8))
    elif kind == 1:  # wood
        pattern = _stripes(rng, size, 0.08) + rough_noise(rng, size, 1.0, rng.uniform(4, 16))
    elif kind == 2:
        pattern = _stripes(rng, size, 0.0) * (1 if rng.random() < 0.5 else _stripes(rng, size, 0.0))
    elif kind == 3:
        pattern = _checks(rng, size)
    elif kind == 4:
        pattern = _cells(rng, size)
    elif kind == 5:  # print: spots of two tones
        pattern = 2.0 * (smooth_noise(rng, size, rng.uniform(4, 24)) > rng.uniform(-0.5, 1.2)) - 1.0
    else:  # fine grain: cloth, sand, lawn
        pattern = rough_noise(rng, size, rng.uniform(0.0, 0.6))
    pattern = pattern + rng.uniform(0.0, 0.5) * rough_noise(rng, size, rng.uniform(0.5, 1.5))
    value, contrast = np.exp(rng.uniform(np.log(0.08), np.log(0.75))), rng.uniform(0.05, 0.5)
    tinted = tint(rng, rng.choice([0.05, 0.2, 0.5]))
    other = tint(rng, rng.choice([0.05, 0.2, 0.5]))
    share = 1 / (1 + np.exp(-2 * pattern[..., None]))
    color = tinted * (1 - share) + other * share
    return np.clip(value * color * np.exp(contrast * pattern[..., None]), 0.02, 0.95).astype(np.float32)
