"""Which directions an object hides from its own surface, and what of its light that changes.

Directions around a pixel are cells: AZIMUTHS about the camera's axis times RINGS, equal in the sine of their elevation
above the picture's plane, so that all have one solid angle. A cell is hidden where the picture itself shows something
in it: between the first face that a pixel sees and where the ray leaves the object again (Therrien, Levesque and
Gilet 2023, Screen Space Indirect Lighting with Visibility Bitmask, who guess that thickness). What a picture does not
show hides nothing.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.render.surface import Surface, pixel_rays

AZIMUTHS, RINGS = 16, 8
SIDE = 64
"""Side of the pictures of hidden cells."""
STEPS = (1, 2, 3, 4, 5, 7, 9, 12, 15, 19, 24, 30, 38, 48)
"""How many of these pixels off a surface is looked for along each azimuth."""
REACH = np.append(np.array(STEPS[1:]) / STEPS[:-1], 1.0)[:, None].astype(np.float32)
"""How many times as far the next step is."""
CELL_SHARPNESS = 25.0
"""Sharpness of the spherical Gaussian as wide as a cell: a lobe is never taken for narrower."""


def hidden_cells(surface: Surface) -> np.ndarray:
    """[AZIMUTHS, SIDE, SIDE] uint8, ring e of an azimuth in bit e; zero off the object.

    Args:
        surface: of a square camera looking straight ahead, whose side is a multiple of SIDE.
    """
    near, far = _points(surface)
    mask = np.isfinite(near[..., 0])
    padded = [
        np.pad(one, ((STEPS[-1],) * 2, (STEPS[-1],) * 2, (0, 0)), constant_values=np.nan)
        for one in (near, far)
    ]
    row, column = np.nonzero(mask)
    own = near[mask]
    edges = (2 * np.arange(RINGS) + 1) / RINGS - 1
    result = np.zeros((AZIMUTHS, SIDE, SIDE), np.uint8)
    for number in range(AZIMUTHS):
        angle = 2 * np.pi * number / AZIMUTHS
        down, right = (
            np.rint(np.array(STEPS) * move).astype(int) for move in (-np.sin(angle), np.cos(angle))
        )
        at = row[:, None] + down + STEPS[-1], column[:, None] + right + STEPS[-1]
        first, last = (one[at] - own[:, None] for one in padded)
        last[..., :2] *= np.where(last[..., 2:] > 0, REACH, 1.0)  # what is found goes on to the next step
        first, last = _sine(first), _sine(last)
        covered = np.zeros(len(own), np.uint8)
        for ring, middle in enumerate(edges):
            covered |= ((last < middle) & (middle < first)).any(axis=1).astype(np.uint8) << ring
        result[number][mask] = covered
    return result


def _points(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Where pixels' rays meet the object and where they leave it, camera frame, [SIDE, SIDE, 3]; NaN off it."""
    size = len(surface.mask)
    every = size // SIDE
    slopes = -pixel_rays(surface.tan_half, size)
    slopes = slopes / -slopes[..., 2:]
    points = []
    for depth in (surface.depth, surface.exit):
        picture = np.full((size, size), np.nan, np.float32)
        picture[surface.mask] = depth
        points.append((slopes * picture[..., None])[every // 2 :: every, every // 2 :: every])
    return points[0], points[1]


def _sine(offset: np.ndarray) -> np.ndarray:
    """Of the elevation of [..., 3]; NaN where there is nothing."""
    return offset[..., 2] / np.maximum(np.sqrt((offset**2).sum(axis=-1)), 1e-9)


def mirrored(hidden: np.ndarray) -> np.ndarray:
    """The cells [AZIMUTHS, S, S] of the picture seen in a mirror, left to right."""
    return hidden[(AZIMUTHS // 2 - np.arange(AZIMUTHS)) % AZIMUTHS, :, ::-1]


def moved(hidden: torch.Tensor, old_from_new: torch.Tensor, offset: torch.Tensor) -> torch.Tensor:
    """The cells [B, AZIMUTHS, S, S] of pictures whose points are moved, as in dataset.reshaped.Reshaping.

    Azimuths turn with the picture, to the nearest; that it is drawn out or gets deeper is left out.

    Args:
        old_from_new: [B, 2, 2], offset: [B, 2], in halves of the picture, x right, y up.
    """
    size = hidden.shape[-1]
    across = (torch.arange(size, dtype=torch.float32) + 0.5) / size * 2 - 1
    up, right = torch.meshgrid(-across, across, indexing="ij")
    old = torch.einsum("bij,hwj->bhwi", old_from_new, torch.stack([right, up], dim=-1))
    grid = (old + offset[:, None, None]) * old.new_tensor([1.0, -1.0])
    there = F.grid_sample(hidden.float(), grid.to(hidden.device), mode="nearest", align_corners=False)
    turn = torch.atan2(
        old_from_new[:, 0, 1] - old_from_new[:, 1, 0], old_from_new[:, 0, 0] + old_from_new[:, 1, 1]
    )
    steps = torch.round(turn * AZIMUTHS / (2 * torch.pi)).long().tolist()
    return torch.stack([one.roll(k, dims=0) for one, k in zip(there, steps, strict=True)]).to(hidden.dtype)


@lru_cache(maxsize=1)
def cell_directions() -> np.ndarray:
    """The middles of the cells, [AZIMUTHS * RINGS, 3] float32."""
    angle = 2 * np.pi * np.arange(AZIMUTHS)[:, None] / AZIMUTHS
    sine = ((2 * np.arange(RINGS) + 1) / RINGS - 1)[None]
    cosine = np.sqrt(1 - sine**2)
    parts = np.broadcast_arrays(np.cos(angle) * cosine, np.sin(angle) * cosine, sine)
    return np.stack(parts, axis=-1).reshape(-1, 3).astype(np.float32)


@lru_cache(maxsize=2)
def _cell_weights(height: int) -> np.ndarray:
    """Mean over a cell from the pixels of a map: [AZIMUTHS * RINGS, H * 2H] float32."""
    d = pixel_directions(height).reshape(-1, 3)
    azimuth = np.rint(np.arctan2(d[:, 1], d[:, 0]) * AZIMUTHS / (2 * np.pi)).astype(int) % AZIMUTHS
    ring = np.clip(((d[:, 2] + 1) / 2 * RINGS).astype(int), 0, RINGS - 1)
    weights = np.zeros((AZIMUTHS * RINGS, len(d)), np.float32)
    solid = np.broadcast_to(pixel_solid_angles(height), (height, 2 * height)).reshape(-1)
    weights[azimuth * RINGS + ring, np.arange(len(d))] = solid
    return weights / weights.sum(axis=1, keepdims=True)


@torch.no_grad()
def shade_hidden(
    hidden: torch.Tensor,
    normals: torch.Tensor,
    wo: torch.Tensor,
    alpha: torch.Tensor,
    radiance: torch.Tensor,
    glow: torch.Tensor,
) -> tuple[torch.Tensor, torch.Tensor]:
    """What becomes of diffuse and of specular light where the object hides part of its surroundings.

    Hidden cells show the object itself, as bright as it is in the mean.

    Args:
        hidden: [B, AZIMUTHS, SIDE, SIDE] uint8.
        normals: [B, 3, S, S]; wo: [B, S, S, 3]; alpha: [B].
        radiance: [B, H, 2H, 3], the maps in the camera's frame; glow: [B, 3], the object's own mean radiance.
    Returns:
        Factors [B, 3, S, S] of the diffuse and of the specular radiance.
    """
    count, size = len(normals), normals.shape[-1]
    d = torch.from_numpy(cell_directions()).to(normals.device)
    weights = torch.from_numpy(_cell_weights(radiance.shape[1])).to(normals.device)
    light = torch.einsum("cp,bpk->bck", weights, radiance.reshape(count, -1, 3))
    factors = normals.new_ones(2, count, 3, SIDE, SIDE)
    small = F.interpolate(normals, size=(SIDE, SIDE), mode="nearest").permute(0, 2, 3, 1)
    eye = F.interpolate(wo.permute(0, 3, 1, 2), size=(SIDE, SIDE), mode="nearest").permute(0, 2, 3, 1)
    bits = 1 << torch.arange(RINGS, device=normals.device, dtype=torch.uint8)
    for one in range(count):
        some = (hidden[one] != 0).any(dim=0) & (small[one].abs().sum(dim=-1) > 0)
        if not some.any():
            continue
        n, toward = small[one][some], eye[one][some]
        shown = (hidden[one][:, some].T[..., None] & bits == 0).reshape(len(n), -1).float()  # [P, cells]
        facing = (n @ d.T).clip(min=0.0)
        for part, lobe in enumerate((facing, facing.sign() * _lobe(n, toward, alpha[one], d))):
            whole = lobe @ light[one]
            left = (lobe * shown) @ light[one] + (lobe * (1 - shown)).sum(1, keepdim=True) * glow[one]
            factors[part, one, :, some] = ((left + 1e-6) / (whole + 1e-6)).T
    wide = F.interpolate(factors.flatten(0, 1), size=(size, size), mode="bilinear", align_corners=False)
    diffuse, specular = wide.unflatten(0, (2, count))
    return diffuse, specular


def _lobe(n: torch.Tensor, wo: torch.Tensor, alpha: torch.Tensor, d: torch.Tensor) -> torch.Tensor:
    """A GGX lobe as a spherical Gaussian (Wang et al. 2009), no narrower than a cell: [P, cells]."""
    cosine = (n * wo).sum(dim=-1, keepdim=True).clip(min=0.1)
    mirror = 2 * cosine * n - wo
    middle = F.normalize(torch.lerp(n, mirror, (1 - alpha) * ((1 - alpha).sqrt() + alpha)), dim=-1)
    sharpness = 1 / (2 * alpha**2 * cosine)
    sharpness = 1 / (1 / sharpness + 1 / CELL_SHARPNESS)
    return torch.exp(sharpness * (middle @ d.T - 1))
