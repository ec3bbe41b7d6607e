"""Patterns: noise that they are made of, and how they lie on objects.

They are laid on from three sides of a block about the object (`lay`), so that they bend with the surface and draw
together towards its edge. They know nothing of what the object is, and change its colour alone, not the normals.
"""

import numpy as np

from anyprobe.core.latlong import corners


def smooth_noise(rng: np.random.Generator, size: int, cells: float) -> np.ndarray:
    """Draw Gaussian noise [size, size] of unit deviation, band-limited to about `cells` waves a side."""
    spectrum, radius = _white_noise(rng, size, 1.0)
    return _unit_deviation(spectrum * np.exp(-0.5 * (radius / cells) ** 2))


def rough_noise(rng: np.random.Generator, size: int, slope: float, aspect: float = 1.0) -> np.ndarray:
    """Draw noise [size, size], its amplitude as frequency to the power -slope; `aspect` stretches its grain across."""
    spectrum, radius = _white_noise(rng, size, aspect)
    return _unit_deviation(spectrum / np.maximum(radius, 1.0) ** slope)


def _white_noise(rng: np.random.Generator, size: int, aspect: float) -> tuple[np.ndarray, np.ndarray]:
    """Draw the spectrum of white noise, and the frequency of each coefficient in waves a side."""
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(frequency[None, :] * aspect, frequency[:, None])
    return np.fft.fft2(rng.standard_normal((size, size))), radius


def _unit_deviation(spectrum: np.ndarray) -> np.ndarray:
    values = np.fft.ifft2(spectrum).real
    return (values - values.mean()) / max(values.std(), 1e-9)


EXTENT = (2.5, 5.0)
"""Range of the period of a pattern [halves of the picture]."""
CLEAR = 6.0
"""Exponent of the normal's components in the weights of a block's sides: higher makes narrower seams."""


def lay(pattern: np.ndarray, points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Lay a pattern [N, N, C] on points [P, 3] of normals [P, 3]: [P, C].

    From three sides of a block turned at random, each where it is faced; beyond its border it goes on mirrored.
    """
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0].astype(np.float32)
    points, facing = points @ turn, np.abs(normals @ turn) ** CLEAR
    facing /= np.maximum(facing.sum(axis=-1, keepdims=True), 1e-6)  # corners of faces without an area have no normal
    extent = float(np.exp(rng.uniform(*np.log(EXTENT))))
    starts = rng.uniform(0, 2, (3, 2)).astype(np.float32)
    size, channels = pattern.shape[0], pattern.shape[-1]
    flat = pattern.reshape(-1, channels)
    result = np.zeros((*points.shape[:-1], channels), np.float32)
    for axis in range(3):
        along = np.delete(points, axis, axis=-1) / extent + starts[axis]
        xy = 1 - 2 * np.abs(1 - along % 2)
        column, row = np.clip((xy.T + 1.0) * (size / 2) - 0.5, 0.0, size - 1.001)
        read = sum(flat[index] * share[:, None] for index, share in corners(column, row, size))
        result = result + facing[:, axis, None] * read
    return result
