"""Projection of the photo beside its object to the sphere by its lens, as the batches of the world have it."""

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions
from anyprobe.light.environment import MAP_HEIGHT

TIMES = 3
"""Samples of a pixel of the sphere in each direction."""
LEAST_DEPTH, LEAST_COVER = 0.05, 1e-3


class SeenOnSphere(nn.Module):
    """Context picture [N, 5, 96, 96] and tangent of half its field [N] -> what it shows beside the object on the
    sphere, [N, 4, 64, 128]: RGB times cover, cover; radiance above white stays."""

    plane: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        columns = MAP_HEIGHT * TIMES
        d = pixel_directions(MAP_HEIGHT * TIMES)[:, columns // 2 : -columns // 2]  # before the camera
        depth = np.where(-d[..., 2] > LEAST_DEPTH, -d[..., 2], np.nan)
        plane = np.nan_to_num(np.stack([d[..., 0] / depth, -d[..., 1] / depth], axis=-1), nan=1e6)
        self.register_buffer("plane", torch.from_numpy(plane).float()[None].contiguous(), persistent=False)

    def forward(self, context: torch.Tensor, half: torch.Tensor) -> torch.Tensor:
        cover = context[:, 4:]
        free = cover * (1.0 - F.max_pool2d(context[:, 3:4], 3, 1, 1))
        picture = torch.cat([context[:, :3] / cover.clamp(min=LEAST_COVER) * free, free], dim=1)
        at = (self.plane / half.view(-1, 1, 1, 1)).clamp(-3.0, 3.0)
        read = F.grid_sample(picture, at, mode="nearest", padding_mode="zeros", align_corners=False)
        return F.pad(F.avg_pool2d(read, TIMES), (MAP_HEIGHT // 2, MAP_HEIGHT // 2))
