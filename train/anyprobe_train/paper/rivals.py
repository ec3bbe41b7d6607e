"""The methods that Figs. 12 and 13 compare with, as networks on the same pairs.

Georgoulis et al. (TPAMI 2017), their direct method: photo to the picture of a mirror sphere. Meka et al. (CVPR 2018):
photo and true normals to a grey mirror image of the object; the same normals unwrap it. Of real photos they are lift's.
"""

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.frames import normalize, reflect
from anyprobe.core.latlong import direction_to_uv, pixel_directions
from anyprobe_train.paper.networks import IlluminationNet, SkipNet

TO_EYE = np.array([0.0, 0.0, 1.0], np.float32)


class MirrorSphereNet(IlluminationNet):
    """Photo RGB and mask [N, 4, S, S] to a mirror sphere [N, 3, R, R], by sphere_uv."""

    columns = 4


class MirrorNet(nn.Module):
    """Photo RGB, mask and normals [N, 7, S, S] to the grey mirror image [N, 1, S, S]."""

    def __init__(self, side: int, width: int) -> None:
        super().__init__()
        self.unet = SkipNet(7, 1, side, width)

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        """Estimate; zero off the object."""
        return self.unet(photo) * photo[:, 3:4]


def mirror_uv(normals: np.ndarray) -> np.ndarray:
    """Return where mirrors of these normals [..., 3] see the map, uv [..., 2]."""
    return direction_to_uv(reflect(np.broadcast_to(TO_EYE, normals.shape), normals))


def sphere_uv(side: int) -> np.ndarray:
    """Return where the pixels of a mirror sphere see the map [side, side, 2].

    Its normals turn evenly along the radius, to 90 degrees at the rim; the corners show what the rim shows.
    """
    x = (np.arange(side) + 0.5) / side * 2 - 1
    right, up = np.meshgrid(x, -x)
    radius = np.hypot(right, up)
    theta = np.minimum(radius, 1.0) * np.pi / 2
    scale = np.sin(theta) / np.maximum(radius, 1e-9)
    return mirror_uv(np.stack([right * scale, up * scale, np.cos(theta)], axis=-1))


def spheres_of(ldr: torch.Tensor) -> torch.Tensor:
    """Draw the mirror spheres [N, 3, R, R] that maps [N, 3, R, 2 R] show."""
    uv = torch.from_numpy(sphere_uv(ldr.shape[2]).astype(np.float32)).to(ldr.device)
    around = torch.cat([ldr[..., -1:], ldr, ldr[..., :1]], dim=3)
    columns = ldr.shape[3]
    x = (uv[..., 0] * columns + 1.0) / (columns + 2.0)
    grid = (2.0 * torch.stack([x, uv[..., 1]], dim=-1) - 1.0).expand(len(ldr), -1, -1, -1)
    return F.grid_sample(around, grid, padding_mode="border", align_corners=False)


def unwrapped_sphere(sphere: torch.Tensor, rows: int) -> torch.Tensor:
    """Unwrap mirror spheres [N, 3, R, R], drawn as sphere_uv says, to maps [N, 3, rows, 2 rows]."""
    half = normalize(pixel_directions(rows) + TO_EYE * (1 + 1e-6))
    theta = np.arccos(np.clip(half[..., 2], -1, 1)) / (np.pi / 2)
    length = np.maximum(np.hypot(half[..., 0], half[..., 1]), 1e-9)
    place = np.stack([half[..., 0], -half[..., 1]], axis=-1) / length[..., None] * theta[..., None]
    grid = torch.from_numpy(place.astype(np.float32)).to(sphere.device).expand(len(sphere), -1, -1, -1)
    return F.grid_sample(sphere, grid, padding_mode="border", align_corners=False)


def unwrapped_mirror(mirror: torch.Tensor, normals: torch.Tensor, mask: torch.Tensor, rows: int) -> torch.Tensor:
    """Unwrap mirror images [N, 1, S, S] of shapes with these normals [N, 3, S, S] to grey maps [N, 3, rows, 2 rows].

    Every pixel goes where it sees the map; what none sees is filled from ever coarser means.
    """
    uv = torch.from_numpy(mirror_uv(normals.permute(0, 2, 3, 1).cpu().numpy())).to(mirror.device)
    column = (uv[..., 0] * 2 * rows).long().clip(0, 2 * rows - 1)
    row = (uv[..., 1] * rows).long().clip(0, rows - 1)
    place, there = (row * 2 * rows + column).flatten(1), mask.flatten(1)
    values = mirror.new_zeros(len(mirror), 2 * rows * rows).scatter_add(1, place, mirror.flatten(1) * there)
    count = torch.zeros_like(values).scatter_add(1, place, there)
    shape = (len(mirror), 1, rows, 2 * rows)
    return _fill(values.reshape(shape), count.reshape(shape)).expand(-1, 3, -1, -1)


def _fill(values: torch.Tensor, count: torch.Tensor) -> torch.Tensor:
    """Divide sums by counts, [N, 1, H, 2H] each; where the count is 0, take the next coarser scale that has some."""
    mean = values / count.clip(min=1e-6)
    if values.shape[2] == 1:
        return mean
    coarse = _fill(4 * F.avg_pool2d(values, 2), 4 * F.avg_pool2d(count, 2))
    return torch.where(count > 0, mean, F.interpolate(coarse, scale_factor=2, mode="bilinear"))
