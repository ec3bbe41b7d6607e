"""Self-shadowing: an object's light where it hides part of its surroundings (dataset.occlusion)."""

from __future__ import annotations

import torch
import torch.nn.functional as F

from anyprobe_train.dataset.occlusion import AZIMUTHS, RINGS, SIDE, cell_directions, cell_weights

CELL_SHARPNESS = 25.0
"""Sharpness of a spherical Gaussian as wide as a cell, the largest that a lobe is given."""


def places(
    size: int, old_from_new: torch.Tensor, offset: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return where pixels are, [S, S, 2], where each was, [B, S, S, 2], and that as grid_sample has it, y down.

    Args:
        old_from_new: [B, 2, 2], offset: [B, 2], in halves of the picture, x right, y up.
    """
    across = (torch.arange(size, device=offset.device, dtype=torch.float32) + 0.5) / size * 2 - 1
    up, right = torch.meshgrid(-across, across, indexing="ij")
    new = torch.stack([right, up], dim=-1)
    old = torch.einsum("bij,hwj->bhwi", old_from_new, new) + offset[:, None, None]
    return new, old, old * old.new_tensor([1.0, -1.0])


def moved(hidden: torch.Tensor, old_from_new: torch.Tensor, offset: torch.Tensor) -> torch.Tensor:
    """Move the cells [B, AZIMUTHS, S, S] of pictures along with their points, as in dataset.shape_augment.Reshaping.

    Azimuths turn with the picture, to the nearest; that it is drawn out or gets deeper is left out. old_from_new,
    offset: of `places`.
    """
    grid = places(hidden.shape[-1], old_from_new, offset)[2]
    there = F.grid_sample(hidden.float(), grid.to(hidden.device), mode="nearest", align_corners=False)
    turn = torch.atan2(old_from_new[:, 0, 1] - old_from_new[:, 1, 0], old_from_new[:, 0, 0] + old_from_new[:, 1, 1])
    steps = torch.round(turn * AZIMUTHS / (2 * torch.pi)).long().tolist()
    return torch.stack([one.roll(k, dims=0) for one, k in zip(there, steps, strict=True)]).to(hidden.dtype)


@torch.no_grad()
def shade_hidden(
    hidden: torch.Tensor,
    normals: torch.Tensor,
    wo: torch.Tensor,
    alpha: torch.Tensor,
    radiance: torch.Tensor,
    glow: torch.Tensor,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Compute factors [B, 3, S, S] of diffuse and of specular light where the object hides part of its surroundings.

    Hidden cells show the object itself, as bright as it is in the mean.

    Args:
        hidden: [B, AZIMUTHS, SIDE, SIDE] uint8.
        normals: [B, 3, S, S]; wo: [B, S, S, 3]; alpha: [B].
        radiance: [B, H, 2H, 3], the maps in the camera's frame; glow: [B, 3], the object's own mean radiance.
    """
    count, size = len(normals), normals.shape[-1]
    d = torch.from_numpy(cell_directions()).to(normals.device)
    weights = torch.from_numpy(cell_weights(radiance.shape[1])).to(normals.device)
    light = torch.einsum("cp,bpk->bck", weights, radiance.reshape(count, -1, 3))
    factors = normals.new_ones(2, count, 3, SIDE, SIDE)
    small = F.interpolate(normals, size=(SIDE, SIDE), mode="nearest").permute(0, 2, 3, 1)
    eye = F.interpolate(wo.permute(0, 3, 1, 2), size=(SIDE, SIDE), mode="nearest").permute(0, 2, 3, 1)
    bits = 1 << torch.arange(RINGS, device=normals.device, dtype=torch.uint8)
    for item in range(count):
        is_affected = (hidden[item] != 0).any(dim=0) & (small[item].abs().sum(dim=-1) > 0)
        if not is_affected.any():
            continue
        n, toward = small[item][is_affected], eye[item][is_affected]
        shown = (hidden[item][:, is_affected].T[..., None] & bits == 0).reshape(len(n), -1).float()  # [P, cells]
        facing = (n @ d.T).clip(min=0.0)
        for part, lobe in enumerate((facing, facing.sign() * _lobe(n, toward, alpha[item], d))):
            total = lobe @ light[item]
            visible = (lobe * shown) @ light[item] + (lobe * (1 - shown)).sum(1, keepdim=True) * glow[item]
            factors[part, item, :, is_affected] = ((visible + 1e-6) / (total + 1e-6)).T
    wide = F.interpolate(factors.flatten(0, 1), size=(size, size), mode="bilinear", align_corners=False)
    diffuse, specular = wide.unflatten(0, (2, count))
    return diffuse, specular


def _lobe(n: torch.Tensor, wo: torch.Tensor, alpha: torch.Tensor, d: torch.Tensor) -> torch.Tensor:
    """Approximate a GGX lobe by a spherical Gaussian (Wang et al. 2009), no narrower than a cell: [P, cells]."""
    cosine = (n * wo).sum(dim=-1, keepdim=True).clip(min=0.1)
    mirror = 2 * cosine * n - wo
    middle = F.normalize(torch.lerp(n, mirror, (1 - alpha) * ((1 - alpha).sqrt() + alpha)), dim=-1)
    sharpness = 1 / (2 * alpha**2 * cosine)
    sharpness = 1 / (1 / sharpness + 1 / CELL_SHARPNESS)
    return torch.exp(sharpness * (middle @ d.T - 1))
