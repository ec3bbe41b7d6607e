"""Targets of SourceHead: the brightest places of true maps, and how much power comes from how close to them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe_train.nets.source_head import APART_DEG, PLACE_DEG, RADII_DEG, SOURCES

LEAST_PULL = 1e-6
"""Weight of the brightest pixel itself, so that a black map has places too."""


@lru_cache(maxsize=2)
def _cap_kernels(height: int) -> torch.Tensor:
    """Fourier transform over the columns of which pixels lie within PLACE_DEG, [row, row of the other, H + 1]."""
    d = pixel_directions(height).astype(np.float64)
    cosine = np.einsum("ic,rwc->irw", d[:, 0], d)
    return torch.fft.rfft(torch.from_numpy((cosine > np.cos(np.radians(PLACE_DEG))).astype(np.float32)), dim=2)


def source_colors(radiance: torch.Tensor, places: torch.Tensor, luminance: torch.Tensor) -> torch.Tensor:
    """Return the mean colours [N, S, 3], of luminance 1, of maps [N, 3, H, 2H] within PLACE_DEG of places [N, S, 3]."""
    height = radiance.shape[2]
    d = torch.from_numpy(pixel_directions(height)).to(radiance).reshape(-1, 3)
    weights = torch.from_numpy(pixel_solid_angles(height)).to(radiance).expand(-1, 2 * height).reshape(-1)
    near = ((places @ d.T) > np.cos(np.radians(PLACE_DEG))).to(radiance) * weights  # [N, S, P]
    colors = torch.einsum("nsp,ncp->nsc", near, radiance.flatten(2))
    return colors / (colors @ luminance)[..., None].clamp(min=1e-9)


def source_profiles(luminance: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the directions [N, SOURCES, 3] of the brightest places of maps [N, H, 2H], and the shares [N, SOURCES,
    len(RADII_DEG)] of the power within RADII_DEG of each.

    A place is the centre of the power within PLACE_DEG of the pixel around which the mean there is the greatest; the
    next the same further than APART_DEG from all before.
    """
    count, height = luminance.shape[:2]
    device = luminance.device
    kernels = _cap_kernels(height).to(device)
    weights = torch.from_numpy(pixel_solid_angles(height)).to(device)
    power = luminance * weights
    power = power / power.sum(dim=(1, 2), keepdim=True).clamp(min=1e-12)
    around, cap = (
        torch.fft.irfft(torch.einsum("irf,nrf->nif", kernels, torch.fft.rfft(one, dim=2)), n=2 * height, dim=2)
        for one in (power, weights.expand(-1, 2 * height)[None])
    )
    d = torch.from_numpy(pixel_directions(height)).to(device).reshape(-1, 3)
    left, flat = (around / cap).flatten(1), power.flatten(1)
    places = []
    for _ in range(SOURCES):
        near = (d[left.argmax(dim=1)] @ d.T > np.cos(np.radians(PLACE_DEG))).to(flat.dtype)
        place = F.normalize((near * flat) @ d + LEAST_PULL * d[left.argmax(dim=1)], dim=1)
        cosine = place @ d.T  # [N, P]
        places.append(place)
        left = left.masked_fill(cosine > np.cos(np.radians(APART_DEG)), -1.0)
    found = torch.stack(places, dim=1)
    return found, shares_around(luminance, found)


def shares_around(luminance: torch.Tensor, places: torch.Tensor) -> torch.Tensor:
    """Return the shares [N, S, len(RADII_DEG)] of the power of maps [N, H, 2H] within RADII_DEG of places [N, S, 3]."""
    height = luminance.shape[1]
    power = (luminance * torch.from_numpy(pixel_solid_angles(height)).to(luminance)).flatten(1)
    power = power / power.sum(dim=1, keepdim=True).clamp(min=1e-12)
    d = torch.from_numpy(pixel_directions(height)).to(luminance).reshape(-1, 3)
    degrees = torch.rad2deg(torch.acos((places @ d.T).clamp(-1.0, 1.0)))  # [N, S, P]
    within = [(0.5 + (r - degrees) * height / 180.0).clamp(0.0, 1.0) for r in RADII_DEG]
    return torch.stack([torch.einsum("np,nsp->ns", power, one) for one in within], dim=2)
