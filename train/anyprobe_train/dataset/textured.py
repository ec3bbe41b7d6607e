"""Objects that are not quite uniform: with a mild texture, or of two materials.

What it is: patterns lie on the object. Where its pixels are in space follows from their normals (`locate`), and
patterns are laid on from three sides of a block about it (`lay`), so that they bend with the surface and draw together
towards its edge. What it is not: the skin of a scan. A jump in depth becomes a slope, patterns know nothing of what the
object is, and they change its colour alone, not the normals. Alpha is one for all in training's photos; a test pair's
second material has its own (`dataset.pair.render_pair`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.camera import blur
from anyprobe_train.dataset.distributions import draw_material
from anyprobe_train.dataset.reflectance import read_disc
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
ON_METAL = 0.5
"""Exponent of the factor for metals, which are tarnished or dirty rather than painted."""
MAX_ALBEDO = 0.95
SECOND_SHARE = (0.1, 0.38)
"""Share of an object's pixels that the second material covers."""
BORDER_PX = 0.6
"""Standard deviation of the blur of the border between two materials [pixels], as a pixel averages what it sees."""
STEEPEST = 0.25
"""Smallest cosine between a normal and the picture's axis when normals are integrated: below it, depth is unbounded."""
SIDES = 128
"""Side of patterns [pixels of their own]."""
EXTENT = (2.5, 5.0)
"""Range of the period of a pattern [halves of the picture]."""
CLEAR = 6.0
"""Exponent of the normal's components in the weights of a block's sides: higher makes narrower seams."""


def locate(normals: np.ndarray) -> np.ndarray:
    """Compute the positions of a picture's pixels in halves of the picture: x right, y up, z to the eye, [S, S, 3].

    The depth whose slopes are nearest to those that normals [S, S, 3] have, by least squares (Frankot and Chellappa
    1988), and off the object, where these are zero, nearest to the object's mean slope.
    """
    size = normals.shape[0]
    mask = np.asarray(normals.any(axis=-1))
    slope = -normals[..., :2] / np.maximum(normals[..., 2:], STEEPEST)
    mean = slope[mask].mean(axis=0)  # which no sum of waves has
    slope = np.where(mask[..., None], slope - mean, 0.0)
    x, y = np.fft.rfft2(slope, axes=(0, 1)).transpose(2, 0, 1)
    right = 2j * np.pi * np.fft.rfftfreq(size, 2 / size)
    up = -2j * np.pi * np.fft.fftfreq(size, 2 / size)[:, None]
    square = right**2 + up**2
    square[0, 0] = 1.0  # the mean depth: of no account
    depth = np.fft.irfft2((right * x + up * y) / square, s=(size, size))
    across = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(across, -across)
    return np.stack([x, y, depth + mean[0] * x + mean[1] * y], axis=-1).astype(np.float32)


def lay(pattern: np.ndarray, points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Lay a pattern [N, N, C] on points [P, 3] of normals [P, 3]: [P, C].

    From three sides of a block turned at random, each where it is faced; beyond its border it goes on mirrored.
    """
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0].astype(np.float32)
    points, facing = points @ turn, np.abs(normals @ turn) ** CLEAR
    facing /= np.maximum(facing.sum(axis=-1, keepdims=True), 1e-6)  # corners of faces without an area have no normal
    extent = float(np.exp(rng.uniform(*np.log(EXTENT))))
    starts = rng.uniform(0, 2, (3, 2)).astype(np.float32)
    channels = range(pattern.shape[-1])
    result = np.zeros((*points.shape[:-1], len(channels)), np.float32)
    for axis in range(3):
        along = np.delete(points, axis, axis=-1) / extent + starts[axis]
        xy = 1 - 2 * np.abs(1 - along % 2)
        result = result + facing[:, axis, None] * np.stack(read_disc(pattern, xy, channels), axis=-1)
    return result


def draw_factor(normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw a texture's factor on reflectance, [S, S, 3], 1 in the mean and off the object; normals as for `locate`."""
    mask, factor = normals.any(axis=-1), np.ones(normals.shape, np.float32)
    factor[mask] = factor_at(locate(normals)[mask], normals[mask], rng)
    return factor


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


def draw_share(normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw the share of an object's second material in each pixel, [S, S] in [0, 1], zero off the object.

    Patches, what lies beyond a plane, or a band; SECOND_SHARE of the object, its border one pixel wide. Normals as for
    `locate`.
    """
    mask = normals.any(axis=-1)
    points, kind = locate(normals)[mask], rng.integers(3)
    if kind == 0:
        pattern = smooth_noise(rng, SIDES, rng.uniform(1.0, 4.0)).astype(np.float32)
        level = lay(pattern[..., None], points, normals[mask], rng)[:, 0]
    else:
        axis = rng.standard_normal(3)
        level = points @ (axis / np.linalg.norm(axis))
        if kind == 2:
            level = -np.abs(level - np.quantile(level, rng.uniform(0.1, 0.9)))
    hard = np.zeros(mask.shape, np.float32)
    hard[mask] = level > np.quantile(level, 1 - rng.uniform(*SECOND_SHARE))
    soft, inside = blur(np.stack([hard, mask.astype(np.float32)]), BORDER_PX)
    return np.where(mask, soft / np.maximum(inside, 1e-6), 0.0).clip(0.0, 1.0)


def paint(material: Material, factor: np.ndarray) -> Material:
    """Apply a texture to a material: f0 and albedo [..., 3] as factor; a dielectric's coat stays as it is."""
    if np.any(material.albedo):
        albedo = np.minimum(material.albedo * factor, MAX_ALBEDO)
        return replace(material, albedo=albedo, f0=np.broadcast_to(material.f0, factor.shape))
    f0 = np.minimum(material.f0 * factor**ON_METAL, 1.0)
    return replace(material, albedo=np.zeros_like(factor), f0=f0)


def mix(first: Material, second: Material, share: np.ndarray) -> Material:
    """Mix two materials of one alpha, share [...] the second: f0 and albedo [..., 3]."""
    share = share[..., None]
    f0, albedo = ((1 - share) * getattr(first, name) + share * getattr(second, name) for name in ("f0", "albedo"))
    return replace(first, f0=f0, albedo=albedo)


def paint_some(
    materials: Sequence[Material], normals: np.ndarray, rng: np.random.Generator, textured: float, two_materials: float
) -> list[Material]:
    """Give a share of objects of normals [B, 3, S, S] a texture, and a share a second material of the same alpha; some
    get both. The f0 and albedo of what is changed are [S, S, 3]."""
    chosen = rng.random((len(materials), 2)) < (textured, two_materials)
    chosen &= np.asarray(normals.any(axis=(1, 2, 3)))[:, None]  # a thin object, reshaped, may have left its picture
    result = list(materials)
    for k in np.flatnonzero(chosen.any(axis=1)):
        n = np.moveaxis(normals[k], 0, -1)
        if chosen[k, 0]:
            result[k] = paint(result[k], draw_factor(n, rng))
        if chosen[k, 1]:
            second = draw_material(rng, result[k].alpha)
            result[k] = mix(result[k], second, draw_share(n, rng))
    return result
