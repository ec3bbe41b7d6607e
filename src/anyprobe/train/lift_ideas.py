"""Losses from elsewhere that were tried on lift (docs/ablation.md): anchors of light, stillness, harmonics, tones."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.harmonics import sh_basis
from anyprobe.nets.light_net import Guess
from anyprobe.nets.tones import logarithm, reinhard

ANCHOR_ROWS = 8
"""The anchors of light are the 128 pixels of a map of so many rows."""
NOISE = 0.01
"""Standard deviation of what the next frame's pixels differ by, of the display's white."""


def angles_between(rows: int) -> torch.Tensor:
    """Angles [radians] between the directions of a map's pixels, [2 rows^2, 2 rows^2]."""
    directions = pixel_directions(rows).reshape(-1, 3).astype(np.float64)
    apart = np.linalg.norm(directions[:, None] - directions[None], axis=-1)
    return torch.from_numpy(2 * np.arcsin(np.minimum(apart / 2, 1.0)).astype(np.float32))


def anchors_loss(guessed: torch.Tensor, true: torch.Tensor, between: torch.Tensor) -> torch.Tensor:
    """How far light must be carried from where it is guessed to where it is: the energy distance, [N].

    2 E|X - Y| - E|X - X'| - E|Y - Y'| of angles [radians]; a metric of distributions as optimal transport is, in
    closed form (Szekely and Rizzo 2013).

    Args:
        guessed, true: [N, 2 H^2], shares of light of a map's pixels.
        between: angles_between the anchors, to which pixels are summed.
    """
    rows = int(round((between.shape[0] / 2) ** 0.5))
    height = int(round((guessed.shape[1] / 2) ** 0.5))
    p, q = (
        F.avg_pool2d(one.unflatten(1, (1, height, 2 * height)), height // rows).flatten(1)
        * (height // rows) ** 2
        for one in (guessed, true)
    )
    d = p - q
    return -torch.einsum("ni,ij,nj->n", d, between, d)


def next_frame(photo: torch.Tensor, progress: float) -> torch.Tensor:
    """The same photos [N, 4, S, S] as a video's next frame has them: other noise, masks a pixel narrower on one side.

    progress: decides both, so that a run goes on exactly.
    """
    if len(photo) == 0:
        return photo
    draw = torch.Generator().manual_seed(int(progress * 2**31))
    noise = NOISE * torch.randn(photo[:, :3].shape, generator=draw).to(photo)
    down, right = (int(torch.randint(-1, 2, (), generator=draw)) for _ in range(2))
    mask = torch.minimum(photo[:, 3:], torch.roll(photo[:, 3:], (down, right), dims=(2, 3)))
    return torch.cat([(photo[:, :3] + noise).clip(0.0, 1.0) * mask, mask], dim=1)


def part(guess: Guess, which: slice) -> Guess:
    """Some of a batch."""
    values = {one.name: getattr(guess, one.name) for one in fields(guess)}
    values = {name: one for name, one in values.items() if one is not None}
    return replace(
        guess,
        **{name: part(one, which) if is_dataclass(one) else one[which] for name, one in values.items()},
    )


def stillness_loss(one: Guess, other: Guess) -> torch.Tensor:
    """How much the light of a frame differs from the next one's (Eilertsen et al., CVPR 2019)."""
    moved = torch.softmax(one.lamp_logit.flatten(1), dim=1) - torch.softmax(
        other.lamp_logit.flatten(1), dim=1
    )
    return (
        (one.ln_shown - other.ln_shown).abs().mean()
        + (one.ln_flux - other.ln_flux).abs().mean()
        + moved.abs().sum(dim=1).mean()
    )


def harmonic_matrix(height: int) -> torch.Tensor:
    """Real spherical harmonics of order 0 to 3 times solid angle at a map's pixels, [16, 2 height^2]."""
    directions = pixel_directions(height).reshape(-1, 3).astype(np.float64)
    x, y, z = directions.T
    third = np.stack(
        [y * (3 * x * x - y * y), x * y * z, y * (5 * z * z - 1), z * (5 * z * z - 3)]
        + [x * (5 * z * z - 1), z * (x * x - y * y), x * (x * x - 3 * y * y)]
    )
    weights = np.repeat(pixel_solid_angles(height)[:, 0].astype(np.float64), 2 * height)
    third /= np.sqrt((third**2 * weights).sum(axis=1, keepdims=True))
    basis = np.concatenate([sh_basis(directions).T, third])
    return torch.from_numpy((basis * weights).astype(np.float32))


def harmonics_loss(ln: torch.Tensor, true_ln: torch.Tensor, matrix: torch.Tensor) -> torch.Tensor:
    """How far a map's first 16 coefficients are from the true map's, as a share of these, [N]."""
    guessed, true = (torch.einsum("kp,ncp->nck", matrix, torch.exp(one).flatten(2)) for one in (ln, true_ln))
    wrong = (guessed - true).square().sum(dim=(1, 2)).sqrt()
    size = true.square().sum(dim=(1, 2)).sqrt()
    return torch.log1p(wrong / size.clamp(min=1e-3))


def tones_loss(tones: torch.Tensor, true_ln: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """Errors of both tone-mapped maps; the logarithm's count three times, since a display has a tenth of its range."""
    e = torch.exp(true_ln)
    terms = [
        (weight * (0.5 * (one - true).abs() + 2 * (one - true).square())).mean()
        for one, true in zip(tones.split(3, dim=1), (reinhard(e), logarithm(e)), strict=True)
    ]
    return terms[0] + 3 * terms[1]
