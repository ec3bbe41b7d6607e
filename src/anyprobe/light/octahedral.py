"""The octahedral pyramid: a map that samplers read at any direction and blur in one gather.

The sphere is unfolded onto a square (Cigolle et al., JCGT 2014); each level halves
the side. A border of one pixel, filled by the folding rule, makes every bilinear
read local, and all levels lie in one flat array so that the level may vary freely.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device, to_device

from anyprobe.core.color import luminance
from anyprobe.core.latlong import bilinear, corners, direction_to_uv, pixel_directions, pixel_solid_angles

WIDENING = 0.75
"""Factor of 1 - r by which an emitter's size widens alpha^2, r the length of its mean direction.

To second order in an emitter's size, the mean of D over it has the peak of a D whose alpha^2 is greater by 1 - r (half
vectors turn half as far). Its flanks are narrower than that D's, so a slightly smaller factor errs least over the lobe.
"""


def take_patches(radiance, count: int, patch: np.ndarray) -> tuple[Any, Any, Any, Any]:
    """Take the brightest patches out of a map [H, 2H, 3]: the excess of their pixels over the next patch's brightest.

    Args:
        patch: [H * 2H] int, the patch of every pixel.
    Returns:
        rest [H, 2H, 3]; directions, the centres of the emitters, and power [K, 3]; spread [K]: what their sizes add to
        alpha^2, WIDENING (1 - r), r the length of an emitter's mean direction.
    """
    xp = array_namespace(radiance)
    height = radiance.shape[0]
    flat = np.asarray(to_device(radiance, "cpu"), np.float64).reshape(-1, 3)
    bright = luminance(flat)
    highest = np.zeros(int(patch.max()) + 1)
    np.maximum.at(highest, patch, bright)
    order = np.argsort(-highest, kind="stable")
    count = min(count, len(order) - 1)
    cap = highest[order[count]]
    pixels = np.flatnonzero(bright > cap)  # all of them lie in the chosen patches
    emitter = np.argsort(order, kind="stable")[patch[pixels]]
    excess = flat[pixels] * (1.0 - cap / bright[pixels])[:, None]
    power = excess * np.repeat(pixel_solid_angles(height), 2 * height, axis=1).reshape(-1, 1)[pixels]
    rest = flat.copy()
    rest[pixels] -= excess

    def total(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(emitter, column, minlength=count) for column in values.T], axis=-1)

    weight = luminance(power)[:, None]
    pointing = total(pixel_directions(height).reshape(-1, 3)[pixels] * weight)
    length = np.linalg.norm(pointing, axis=1)
    directions = np.where(length[:, None] > 0, pointing / np.maximum(length, 1e-30)[:, None], (0.0, 1.0, 0.0))
    spread = WIDENING * np.clip(1.0 - length / np.maximum(total(weight)[:, 0], 1e-30), 0.0, None)
    found = (rest.reshape(radiance.shape), directions, total(power), np.where(length > 0, spread, 0.0))
    return tuple(xp.asarray(values.astype(np.float32), device=device(radiance)) for values in found)


def _sign(x):
    """Return 1 where x >= 0, else -1, with the kind and precision of x."""
    xp = array_namespace(x)
    return xp.where(x >= 0, xp.ones_like(x), -xp.ones_like(x))


def _unfold(x, y, z):
    """Convert components of unit directions to coordinates s, t in [0, 1]; +Y is the centre."""
    xp = array_namespace(x)
    norm = xp.abs(x) + xp.abs(y) + xp.abs(z)
    a, b = x / norm, z / norm
    below = y < 0
    s = xp.where(below, (1.0 - xp.abs(b)) * _sign(a), a)
    t = xp.where(below, (1.0 - xp.abs(a)) * _sign(b), b)
    return s * 0.5 + 0.5, t * 0.5 + 0.5


def direction_to_octahedral(d):
    """Convert unit directions [..., 3] to the unit square [..., 2]; +Y is the centre."""
    xp = array_namespace(d)
    return xp.stack(_unfold(d[..., 0], d[..., 1], d[..., 2]), axis=-1)


def octahedral_to_direction(st):
    """Convert the unit square [..., 2] to unit directions [..., 3]; inverse of direction_to_octahedral."""
    xp = array_namespace(st)
    a, b = st[..., 0] * 2.0 - 1.0, st[..., 1] * 2.0 - 1.0
    y = 1.0 - xp.abs(a) - xp.abs(b)
    below = xp.clip(-y, 0.0, None)
    x = a - _sign(a) * below
    z = b - _sign(b) * below
    v = xp.stack([x, y, z], axis=-1)
    return v / xp.sqrt(xp.sum(v * v, axis=-1, keepdims=True))


@dataclass(frozen=True, kw_only=True, slots=True)
class Pyramid:
    """Pyramid of averaged levels: texels [T, 3], the side of level 0, and the number of levels.

    emitters [K, 3], emitter_power [K, 3]: directions and irradiance (at normal incidence) of the brightest pixels' or
        patches' excess over the next brightest; None without emitters. The texels hold the rest: shading adds the
        emitters exactly, so that no sample need hit the sun.
    emitter_spread: what the emitters' sizes add to alpha^2, [K].
    """

    texels: Any
    side: int
    num_levels: int
    emitters: Any = None
    emitter_power: Any = None
    emitter_spread: Any = None


@lru_cache(maxsize=8)
def _resampling(side: int) -> np.ndarray:
    """Return the map coordinates of the texels' subsamples, two along each side: [side, 2, side, 2, 2]."""
    centres = (np.arange(2 * side) + 0.5) / (2 * side)
    st = np.stack(np.meshgrid(centres, centres), axis=-1)
    return direction_to_uv(octahedral_to_direction(st)).astype(np.float32).reshape(side, 2, side, 2, 2)


@lru_cache(maxsize=16)
def _border_index(side: int) -> np.ndarray:
    """Return indices [side + 2, side + 2] into a level that fill its border by the octahedron's folding."""
    row, column = np.mgrid[-1 : side + 1, -1 : side + 1]
    # over the top or bottom edge the columns turn round, over a side edge the rows do
    over_row = (row < 0) | (row >= side)
    column = np.where(over_row, side - 1 - column, column)
    row = np.clip(row, 0, side - 1)
    over_column = (column < 0) | (column >= side)
    row = np.where(over_column, side - 1 - row, row)
    return (row * side + np.clip(column, 0, side - 1)).reshape(-1)


@lru_cache(maxsize=8)
def _patches(height: int, side: int) -> np.ndarray:
    """Return the index of the square, of side x side on the unfolded sphere, that each pixel of a map lies in, [H *
    2H]."""
    st = direction_to_octahedral(pixel_directions(height).reshape(-1, 3))
    column, row = np.clip((st * side).astype(int), 0, side - 1).T
    return row * side + column


def build_pyramid(radiance, side: int = 256, emitters: int = 0, patches: int | None = None) -> Pyramid:
    """Unfold a map [H, 2H, 3] and average it down level by level to 4 x 4.

    Args:
        radiance: NumPy array or torch tensor.
        side: texels along level 0; 256 holds a 256 x 512 map.
        emitters: number of brightest pixels that become emitters. A pyramid with emitters is for
            shading; lookup alone does not see them.
        patches: take whole patches as emitters instead, of patches x patches on the unfolded sphere: an emitter in a
            room covers many pixels of similar brightness, and a few of them would leave nearly all of it.
    """
    xp = array_namespace(radiance)
    directions = power = spread = None
    if emitters:
        patch = np.arange(2 * radiance.shape[0] ** 2) if patches is None else _patches(radiance.shape[0], patches)
        radiance, directions, power, spread = take_patches(radiance, emitters, patch)
        spread = spread + 1.0 / side**2
    uv = xp.asarray(_resampling(side), device=device(radiance))
    level = xp.mean(xp.mean(bilinear(radiance, uv), axis=3), axis=1)
    levels, size = [], side
    while True:
        index = xp.asarray(_border_index(size), device=device(radiance))
        levels.append(xp.take(xp.reshape(level, (size * size, 3)), index, axis=0))
        if size == 4:
            break
        level = xp.mean(xp.mean(xp.reshape(level, (size // 2, 2, size // 2, 2, 3)), axis=3), axis=1)
        size //= 2
    return Pyramid(
        texels=xp.concat(levels, axis=0),
        side=side,
        num_levels=len(levels),
        emitters=directions,
        emitter_power=power,
        emitter_spread=spread,
    )


def lookup_rgb(pyramid: Pyramid, x, y, z, lod):
    """Look up radiance around unit directions at the level nearest to lod.

    Level 0 is the map itself; each further level averages four texels of the last. Directions and colours are in
    components, which a compiler turns into vector code.

    Args:
        x, y, z, lod: one shape.
    Returns:
        red, green, blue: the same shape.
    """
    xp = array_namespace(x)
    level = xp.clip(xp.round(lod), 0, pyramid.num_levels - 1)
    size = pyramid.side / xp.exp2(level) if hasattr(xp, "exp2") else pyramid.side / 2.0**level
    s, t = _unfold(x, y, z)
    # texels before a level: the sum of (s + 2)^2 over the larger sides s, a geometric series
    s0 = float(pyramid.side)
    before = (s0 * s0 - size * size) * (4.0 / 3.0) + (s0 - size) * 8.0 + 4.0 * level
    around = corners(s * size + 0.5, t * size + 0.5, size + 2.0, before)  # +0.5: the border's width less half a texel
    return tuple(sum(pyramid.texels[index, channel] * weight for index, weight in around) for channel in range(3))
