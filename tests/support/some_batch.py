"""A batch of random numbers in the shapes of training pairs."""

from __future__ import annotations

import torch

from anyprobe_train.dataset.pair_source import Batch


def some_batch(count: int = 4) -> Batch:
    """Unit normals that face the camera everywhere; no normals are told, nothing around is known."""
    generator = torch.Generator().manual_seed(0)

    def values(*shape):
        return torch.rand(shape, generator=generator)

    normals = torch.nn.functional.normalize(
        values(count, 3, 128, 128) - torch.tensor([0.5, 0.5, -1]).reshape(3, 1, 1), dim=1
    )
    return Batch(
        photo=values(count, 4, 128, 128),
        irradiance=values(count, 3, 128, 128),
        ldr=values(count, 3, 64, 128),
        ln_radiance=values(count, 3, 64, 128),
        alpha=values(count),
        normals=normals,
        tan_half=0.2 * values(count),
        given_normals_rotation=torch.zeros(count, 3, 3),
        surroundings=torch.zeros(count, 4, 64, 128),
        material=torch.cat([torch.ones(count, 1), values(count, 7)], dim=1),
        given_material=torch.zeros(count, 8),
    )
