"""Backgrounds behind the objects of a scene: the surroundings, walls, plain paper, a table, flat things."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from anyprobe.core.frames import rotation_x
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.render.surface import pixel_rays
from anyprobe_train.dataset.camera import blur
from anyprobe_train.dataset.sky import tint
from anyprobe_train.mask_network.foregrounds import LitView, TexturePool

PLAIN_SHARE, WALL_SHARE = 0.15, 0.2
"""Shares of backgrounds of one colour and of a pattern; the rest show the map."""

FLAT_SHARE = 0.65
"""Share of the latter that are a crop of the stored map, about as sharp as a photo; a camera of usual field of view
would see only a few of its pixels, blurred."""

SOFT_SHARE, SOFTEST = 0.35, 0.02
"""Share of backgrounds out of focus, and their largest blur [sides of the picture]."""

GROUND_SHARE = 0.65
"""Share of scenes with a table or a floor."""

EYE_HEIGHT = 1.0
"""Height of the camera above the ground, which scales the ground's textures."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PhotoGrid:
    """Pixels of a photo: centres x, y [S, S] in (-1, 1), y down, and tan of half the field of view."""

    x: torch.Tensor
    y: torch.Tensor
    tan_half: float


def make_window(size: int, tan_half: float) -> PhotoGrid:
    """Return the pixels of a square photo."""
    line = (torch.arange(size) + 0.5) / size * 2 - 1
    y, x = torch.meshgrid(line, line, indexing="ij")
    return PhotoGrid(x=x, y=y, tan_half=tan_half)


def draw_background(rng: np.random.Generator, view: LitView, window: PhotoGrid, pool: TexturePool) -> torch.Tensor:
    """Draw the radiance [3, S, S] of everything but objects and shadows."""
    picture = _behind(rng, view, window, pool)
    size = len(window.x)
    if rng.random() < SOFT_SHARE:
        picture = blur(picture, float(rng.uniform(0.002, SOFTEST)) * size)
    if rng.random() < GROUND_SHARE:
        color, cover = _ground(rng, view, window, pool)
        picture = torch.lerp(picture, color, cover)
    for _ in range(int(rng.integers(0, 4))):
        color, cover = draw_flat(rng, view, window, pool)
        picture = torch.lerp(picture, color, cover)
    return picture


def draw_flat(
    rng: np.random.Generator, view: LitView, window: PhotoGrid, pool: TexturePool
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw a thing with straight edges (book, frame, rod, shelf): radiance [3, S, S], cover [S, S]."""
    centre, angle = rng.uniform(-1.1, 1.1, size=2), rng.uniform(0, np.pi)
    if rng.random() < 0.5:
        angle = rng.choice([0.0, np.pi / 2]) + rng.normal(0, 0.05)
    half = np.exp(rng.uniform(np.log(0.03), np.log(0.7), size=2))
    dx, dy = window.x - float(centre[0]), window.y - float(centre[1])
    across = dx * float(np.cos(angle)) + dy * float(np.sin(angle))
    down = dy * float(np.cos(angle)) - dx * float(np.sin(angle))
    narrower = 1.0 + float(rng.uniform(-0.5, 0.5)) * down  # as perspective would have it
    soft = len(window.x) / 2  # edges one pixel wide
    cover = ((half[0] * narrower - across.abs()) * soft + 0.5).clip(0, 1)
    cover = cover * ((half[1] - down.abs()) * soft + 0.5).clip(0, 1)
    if rng.random() < 0.4:
        color = torch.tensor(rng.uniform(0.02, 0.9) * tint(rng, 0.4), dtype=torch.float32)[:, None, None]
    else:
        scale = float(np.exp(rng.uniform(np.log(0.7), np.log(4.0))))
        color = pool.read(rng, across * scale, down * scale)
    return color * _lit(rng, view, window), cover


def _behind(rng: np.random.Generator, view: LitView, window: PhotoGrid, pool: TexturePool) -> torch.Tensor:
    kind = rng.random()
    if kind < PLAIN_SHARE:
        value = rng.choice([0.0, 0.02, rng.uniform(0.02, 0.9), 0.9, 1.5])
        color = torch.tensor(value * tint(rng, rng.choice([0.02, 0.2])), dtype=torch.float32)
        return color[:, None, None] * _lit(rng, view, window)
    if kind < PLAIN_SHARE + WALL_SHARE:
        scale = float(np.exp(rng.uniform(np.log(0.5), np.log(5.0))))
        slant = float(rng.normal(0, 0.3))
        x = (window.x + slant * window.y + float(rng.uniform(-3, 3))) * scale
        return pool.read(rng, x, window.y * scale) * _lit(rng, view, window)
    size = len(window.x)
    if rng.random() < FLAT_SHARE:
        reach = float(rng.uniform(0.12, 0.25))  # half of what is seen, in the map's width
        u = (float(rng.random()) + reach * window.x) % 1.0
        v = (float(rng.normal(0.5, 0.06)) + 2 * reach * window.y).clip(0.02, 0.98)
        picture = bilinear(view.sky, torch.stack([u, v], dim=-1).reshape(-1, 2)).T.reshape(3, size, size)
    else:
        wo = pixel_rays(window.tan_half, size).reshape(-1, 3)
        world = torch.from_numpy((-wo @ view.world_from_camera.T).astype(np.float32))
        picture = bilinear(view.sky, direction_to_uv(world)).T.reshape(3, size, size)
    if rng.random() < 0.4:  # a map is coarser than a photo: give it grain of its own
        scale = float(np.exp(rng.uniform(np.log(0.5), np.log(4.0))))
        grain = pool.read(rng, window.x * scale, window.y * scale)
        grain = grain / grain.mean(dim=(1, 2), keepdim=True).clip(min=1e-3)
        picture = picture * grain ** float(rng.uniform(0.2, 1.0))
    return picture


def _ground(
    rng: np.random.Generator, view: LitView, window: PhotoGrid, pool: TexturePool
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw a level plane below the camera, whole or a table's top: radiance [3, S, S] and cover [S, S]."""
    size = len(window.x)
    pitch = max(view.elevation, 0.02) + rng.uniform(0.0, 0.3)
    down = (-pixel_rays(window.tan_half, size) @ rotation_x(-pitch).T).astype(np.float32)
    ray = torch.from_numpy(down)
    distance = EYE_HEIGHT / (-ray[..., 1]).clip(min=1e-3)
    x, z = ray[..., 0] * distance, ray[..., 2] * distance
    cover = ((-ray[..., 1] - 0.01) * 200).clip(0, 1)
    angle = float(rng.uniform(0, np.pi))
    a = x * float(np.cos(angle)) + z * float(np.sin(angle))
    b = z * float(np.cos(angle)) - x * float(np.sin(angle))
    if rng.random() < 0.5:  # a table: its edges lie around where the camera looks
        reach = EYE_HEIGHT / np.tan(pitch)
        middle_a, middle_b = -reach * np.sin(angle), -reach * np.cos(angle)
        half = np.exp(rng.uniform(np.log(0.4), np.log(2.5), size=2))
        inside = ((a - middle_a).abs() < half[0]) & ((b - middle_b).abs() < half[1])
        cover = cover * inside.float()
    if rng.random() < 0.35:
        color = torch.tensor(rng.uniform(0.03, 0.9) * tint(rng, 0.15), dtype=torch.float32)[:, None, None]
        color = color.expand(3, size, size)
    else:
        scale = float(np.exp(rng.uniform(np.log(0.5), np.log(6.0))))
        color = pool.read(rng, a * scale, b * scale)
        far = (distance / 8.0).clip(0, 1)  # grain finer than a pixel averages out
        color = torch.lerp(color, color.mean(dim=(1, 2), keepdim=True).expand_as(color), far)
    return color * _lit(rng, view, window), cover


def _lit(rng: np.random.Generator, view: LitView, window: PhotoGrid) -> torch.Tensor:
    """Draw the radiance of white paper [3, S, S]: the ground's, brighter on one side, some with a pool of light."""
    gain = np.exp(rng.normal(0, 0.4))
    slope = rng.normal(0, 0.3, size=2)
    shading = torch.exp(float(slope[0]) * window.x + float(slope[1]) * window.y)
    if rng.random() < 0.2:
        x, y = rng.uniform(-1, 1, size=2)
        width = rng.uniform(0.2, 1.0)
        pool = torch.exp(-(((window.x - float(x)) ** 2 + (window.y - float(y)) ** 2) / float(width) ** 2))
        shading = shading * (1 + float(rng.uniform(0.5, 3.0)) * pool)
    color = torch.tensor(view.ground * gain, dtype=torch.float32)
    return color[:, None, None] * shading
