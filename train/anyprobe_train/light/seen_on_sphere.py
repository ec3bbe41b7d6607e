"""Projection of the photo beside its object to the sphere by its lens, as the batches of the world have it."""

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.light.environment import MAP_HEIGHT

TIMES = 3
"""Samples of a pixel of the sphere in each direction."""
LEAST_COVER = 1e-3


class SeenOnSphere(nn.Module):
    """Context picture [N, 5, 96, 96] and tangent of half its field [N] -> what it shows beside the object on the
    sphere, [N, 4, 64, 128]: RGB times cover, cover; radiance above white stays."""

    across: torch.Tensor
    rise: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        rows = MAP_HEIGHT * TIMES
        angle = torch.linspace(0.5, rows - 0.5, rows, dtype=torch.float64) * (np.pi / rows) - np.pi / 2
        for name in ("across", "rise"):  # before the camera, from the left and from above
            self.register_buffer(name, torch.tan(angle).float(), persistent=False)

    def forward(self, context: torch.Tensor, half: torch.Tensor) -> torch.Tensor:
        cover = context[:, 4:]
        free = cover * (1.0 - F.max_pool2d(context[:, 3:4], 3, 1, 1))
        picture = torch.cat([context[:, :3] / cover.clamp(min=LEAST_COVER) * free, free], dim=1)
        down = (self.rise / half[:, None])[:, :, None] * torch.sqrt(1.0 + self.across**2)
        across = (self.across / half[:, None])[:, None].expand_as(down)
        at = torch.stack([across, down], dim=-1).clamp(-3.0, 3.0)
        read = F.grid_sample(picture, at, mode="nearest", padding_mode="zeros", align_corners=False)
        return F.pad(F.avg_pool2d(read, TIMES), (MAP_HEIGHT // 2, MAP_HEIGHT // 2))
