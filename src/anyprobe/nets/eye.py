"""Where the eye is, seen from the points of a photo: what a network must know of the camera."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.render.surface import pixel_rays

SIZE = 64
"""Side of the pictures of normals, of directions and of features; photo and irradiance have twice as much."""


class Eye(nn.Module):
    """tan_half [N, 1] of half the field of view -> slope [N, 2, 64, 64] and wo [N, 3, 64, 64].

    wo: unit directions from each pixel's point to the eye, camera frame; slope: their x / z and y / z.
    """

    def __init__(self) -> None:
        super().__init__()
        unit = torch.from_numpy(pixel_rays(1.0, SIZE)).permute(2, 0, 1)
        self.register_buffer("slope", (unit[:2] / unit[2:])[None], persistent=False)  # [1, 2, S, S]

    def forward(self, tan_half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        slope = self.slope * tan_half[:, :, None, None]
        wo = torch.cat([slope, torch.ones_like(slope[:, :1])], dim=1)
        return slope, wo / wo.square().sum(dim=1, keepdim=True).sqrt()
