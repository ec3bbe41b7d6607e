"""Objects that are not quite uniform: patterns that lie on them.

Patterns are laid on from three sides of a block about the object (`lay`), so that they bend with the surface and draw
together towards its edge. They know nothing of what the object is, and change its colour alone, not the normals.
"""

import numpy as np

from anyprobe.core.latlong import corners
from anyprobe_train.dataset.sky import tint


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
    """Draw Voronoi cells: pebbles, tiles, terrazzo."""
    y, x = np.mgrid[0:size, 0:size] / size
    points = rng.random((int(rng.integers(8, 60)), 2))
    distance = (x[..., None] - points[:, 0]) ** 2 + (y[..., None] - points[:, 1]) ** 2
    return rng.standard_normal(len(points))[distance.argmin(axis=-1)]


def draw_texture(rng: np.random.Generator, size: int = 128) -> np.ndarray:
    """Draw one pattern of a random family in random colours, [size, size, 3] in [0.02, 0.95]."""
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


CONTRAST, CONTRAST_SPREAD = 0.19, 0.35
"""Median and standard deviation of the logarithm of a texture's contrast, which is the standard deviation of the
factor's logarithm: most are between 0.1 and 0.35."""
COLORED_SHARE = 0.35
"""Share of textures of several colours; the rest varies in brightness only."""
SIDES = 128
"""Side of patterns [pixels of their own]."""
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


def factor_at(points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw the factor of draw_factor at points [P, 3] of a surface with normals [P, 3]: [P, 3], 1 in the mean.

    Marble, wood, cloth, tiles, print or dirt as `draw_texture` has them, of little contrast.
    """
    contrast = CONTRAST * np.exp(rng.normal(0.0, CONTRAST_SPREAD))
    pattern = np.log(draw_texture(rng, SIDES))
    if rng.random() >= COLORED_SHARE:
        pattern = pattern.mean(axis=-1, keepdims=True)
    pattern -= pattern.mean(axis=(0, 1))
    deviation = float(np.sqrt((pattern**2).mean()))
    pattern *= contrast / max(deviation, 1e-6)  # one clipped all over has none
    values = np.exp(lay(pattern, points, normals, rng))
    return np.broadcast_to(values / values.mean(axis=0), normals.shape)
