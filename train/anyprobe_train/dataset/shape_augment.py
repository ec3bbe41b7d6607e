"""Augmentation of shape: rasterised normal images deformed without their mesh.

A surface seen in perspective is the logarithm of its depth over the picture, rho(x, y), for x and y of the
points on the plane at depth 1. Its normal is along (rho_x, rho_y, 1 + x rho_x + y rho_y), so rho's slopes can
be read off it, and any other smooth rho is a surface again, of which the same points are seen: in perspective
what Belhumeur, Kriegman and Yuille (The Bas-Relief Ambiguity, IJCV 1999) do to depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe_train.dataset.shadows import moved, places

UPRIGHT_DEG = 15.0
"""Standard deviation of the roll of half of the pictures [degrees]; the others are rolled by any angle."""
STRETCH = 0.15
"""Standard deviation of the logarithm by which a picture is stretched along one axis and compressed along the other."""
DEPTH = 0.3
"""Standard deviation of the logarithm of the factor on slopes."""
_MARGIN = (1.04, 1.2)
"""Range of the picture's side over the longer side of the object's box, as for rasterised surfaces."""
SLOW, FAST = (1.0, 4.0), (6.0, 25.0)
"""Frequencies of the waves that bend the surface, and of those that emboss it [radians per half picture]."""
MAX_SLOW_SLOPE, MAX_FAST_SLOPE = 0.5, 0.4
"""Largest sum of the slopes of each kind of waves."""
JOINED = (0.25, 0.7)
"""Size range of a surface put before another, relative to its own size."""
_MIN_COSINE = 0.02
"""Smallest cosine between a normal and the ray to the eye: an interpolated normal may face away."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Reshaping:
    """Deformation of B surfaces; positions are in halves of the picture, x right, y up.

    old_from_new [B, 2, 2], offset [B, 2]: where each new place was.
    deeper [B]: how many times steeper the surface gets.
    waves [B, K, 2, 2]: slope, then speed, along x and y, of waves that are added; phases [B, K].
    """

    old_from_new: torch.Tensor
    offset: torch.Tensor
    deeper: torch.Tensor
    waves: torch.Tensor
    phases: torch.Tensor


def reshape_some(
    normals: torch.Tensor,
    tan_half: torch.Tensor,
    rng: np.random.Generator,
    share: float,
    hidden: torch.Tensor | None = None,
) -> torch.Tensor:
    """Reshape about a share of the surfaces; arguments and result as in `reshape`.

    hidden: their cells of dataset.occlusion, which are moved along in place.
    """
    chosen = np.nonzero(rng.random(len(normals)) < share)[0]
    if len(chosen) == 0:
        return normals
    result = normals.clone()
    reshaping = draw_reshaping((normals[chosen].abs().sum(dim=1) > 0).cpu().numpy(), rng)
    result[chosen] = reshape(normals[chosen], tan_half[chosen], reshaping)
    if hidden is not None:
        hidden[chosen] = moved(hidden[chosen], reshaping.old_from_new, reshaping.offset)
    return result


def join_some(
    normals: torch.Tensor,
    tan_half: torch.Tensor,
    others: torch.Tensor,
    other_tan_half: torch.Tensor,
    rng: np.random.Generator,
    share: float,
) -> torch.Tensor:
    """Put another surface, smaller and turned, before about a share of the surfaces, like a limb or a knob.

    Arguments and result as for `reshape`; the others are as many.
    """
    chosen = np.nonzero(rng.random(len(normals)) < share)[0]
    if len(chosen) == 0:
        return normals
    places = []
    for mask in (normals[chosen].abs().sum(dim=1) > 0).cpu().numpy():
        scale = np.exp(rng.uniform(*np.log(JOINED)))
        on_mask = rng.choice(np.argwhere(mask))[::-1]
        centre = ((on_mask + 0.5) * 2 / len(mask) - 1) * [1.0, -1.0]
        centre = np.clip(centre, -1 + 1.2 * scale, 1 - 1.2 * scale)  # all of it inside the picture
        old_from_new = _turn(rng.uniform(0, 2 * np.pi)) / scale
        places.append((old_from_new, -old_from_new @ centre, 1.0, np.zeros((0, 2, 2)), np.zeros(0)))
    before = reshape(others[chosen], other_tan_half[chosen], _stack(places), tan_half[chosen])
    result = normals.clone()
    result[chosen] = torch.where(before.abs().sum(dim=1, keepdim=True) > 0, before, normals[chosen])
    return result


def draw_reshaping(masks: np.ndarray, rng: np.random.Generator) -> Reshaping:
    """Draw deformations of objects of masks [B, S, S], on the CPU: roll, stretch, depth, bending and relief.

    Each object fills its picture as it did before.
    """
    return _stack([_draw(mask, rng) for mask in masks])


def _stack(tuples: list[tuple]) -> Reshaping:
    parts = (torch.from_numpy(np.stack(part).astype(np.float32)) for part in zip(*tuples, strict=True))
    return Reshaping(**dict(zip(Reshaping.__slots__, parts, strict=True)))


def _draw(mask: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return the parts of one object's Reshaping, in their order."""
    roll = rng.normal(0.0, np.radians(UPRIGHT_DEG)) if rng.random() < 0.5 else rng.uniform(0, 2 * np.pi)
    along, drawn_out = rng.uniform(0, np.pi), np.exp(rng.normal(0.0, STRETCH))
    new_from_old = _turn(roll) @ _turn(along) @ np.diag([drawn_out, 1 / drawn_out]) @ _turn(-along)
    row, column = np.nonzero(mask)
    places = (np.stack([column, row], axis=1) + 0.5) * 2 / mask.shape[0] - 1
    places = places * [1.0, -1.0] @ new_from_old.T
    low, high = places.min(axis=0), places.max(axis=0)
    half = (high - low).max() / 2 * rng.uniform(*_MARGIN)
    old_from_new = np.linalg.inv(new_from_old)
    waves = [_waves(rng, SLOW, MAX_SLOW_SLOPE), _waves(rng, FAST, MAX_FAST_SLOPE)]
    return (
        old_from_new * half,
        old_from_new @ (low + high) / 2,
        np.exp(rng.normal(0.0, DEPTH)),
        np.concatenate(waves),
        rng.uniform(0, 2 * np.pi, 6),
    )


def _waves(rng: np.random.Generator, frequencies: tuple[float, float], max_slope: float) -> np.ndarray:
    """Draw three plane waves [3, 2, 2]: slope and frequency along x and y."""
    angle = rng.uniform(0, 2 * np.pi, 3)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    slope = rng.dirichlet(np.ones(3)) * rng.uniform(0.0, max_slope)
    frequency = np.exp(rng.uniform(np.log(frequencies[0]), np.log(frequencies[1]), 3))
    return np.stack([along * slope[:, None], along * frequency[:, None]], axis=1)


def _turn(angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def reshape(
    normals: torch.Tensor, tan_half: torch.Tensor, reshaping: Reshaping, new_tan_half: torch.Tensor | None = None
) -> torch.Tensor:
    """Reshape surfaces of normals [B, 3, S, S], camera frame, zero outside the objects; return unit, visible normals.

    tan_half: [B] of half the field of view; new_tan_half: that of the result, by default the same.
    """
    device = normals.device
    new, old, grid = places(normals.shape[-1], reshaping.old_from_new.to(device), reshaping.offset.to(device))
    n = F.grid_sample(normals, grid, padding_mode="zeros", align_corners=False)
    inside = n.square().sum(dim=1, keepdim=True) > 0.25
    n = n.movedim(1, -1)
    t = tan_half.to(device).reshape(-1, 1, 1)
    facing = n[..., 2] - t * (n[..., :2] * old).sum(dim=-1)  # n . (-x, -y, 1)
    length = torch.sqrt(1 + t**2 * old.square().sum(dim=-1))
    slope = n[..., :2] / torch.maximum(facing, _MIN_COSINE * length)[..., None]  # rho_x, rho_y
    linear = reshaping.old_from_new.mT / torch.linalg.det(reshaping.old_from_new).sqrt()[:, None, None]
    slope = torch.einsum("bij,bhwj->bhwi", (linear * reshaping.deeper[:, None, None]).to(device), slope)
    waves, phases = reshaping.waves.to(device), reshaping.phases.to(device)
    for wave, phase in zip(waves.unbind(dim=1), phases.unbind(dim=1), strict=True):
        swing = torch.cos(torch.einsum("bi,hwi->bhw", wave[:, 1], new) + phase[:, None, None])
        slope = slope + swing[..., None] * wave[:, None, None, 0]
    t = t if new_tan_half is None else new_tan_half.to(device).reshape(-1, 1, 1)
    depth = 1 + t * (slope * new).sum(dim=-1)
    result = torch.cat([slope, depth[..., None]], dim=-1).movedim(-1, 1)
    return torch.where(inside, F.normalize(result, dim=1), 0.0)
