"""Objects that are not quite uniform: marble, wood, cloth, tiles, print or dirt of little contrast on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.render.mesh import Mesh
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.recipe import WORLD, Recipe
from anyprobe_train.dataset.sky import tint
from anyprobe_train.dataset.textured import lay, rough_noise, smooth_noise

CONTRAST, CONTRAST_SPREAD = 0.19, 0.35
"""Median and standard deviation of the logarithm of a texture's contrast, which is the standard deviation of the
factor's logarithm: most are between 0.1 and 0.35."""
COLORED_SHARE = 0.35
"""Share of textures of several colours; the rest varies in brightness only."""
SIDES = 128
"""Side of patterns [pixels of their own]."""
PAINTED_ALBEDO = 0.95
"""Largest albedo under a texture."""


def is_painted(recipe: Recipe) -> bool:
    """Return whether a recipe is of a painted object under WORLD conditions."""
    return recipe.conditions == WORLD and distributions.KINDS[recipe.material % 4] == "painted"


def painted(material: Material, mesh: Mesh, rng: np.random.Generator) -> Material:
    """Return the material under a mild texture that lies on the mesh: albedo [F, 3, 3], at the corners of the faces."""
    corners = mesh.positions[mesh.faces].reshape(-1, 3).astype(np.float32)
    factor = factor_at(corners, mesh.normals.reshape(-1, 3).astype(np.float32), rng)
    return replace(material, albedo=np.minimum(material.albedo * factor.reshape(-1, 3, 3), PAINTED_ALBEDO))


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


def factor_at(points: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw the factor of a mild texture at points [P, 3] of a surface with normals [P, 3]: [P, 3], 1 in the mean.

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
