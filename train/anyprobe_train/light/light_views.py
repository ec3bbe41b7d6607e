"""From a photo, its object's window and its lens to what the light network sees: the same tensors as the world makes.

All of it belongs to the exported graph, which takes one photo at a time; the world makes batches of them.
"""

from __future__ import annotations

import torch
from torch import nn

from anyprobe_train.light.given import SHORTEST, Given, square_around
from anyprobe_train.light.network import NORMALS_SIDE, PICTURE_PX, LightInputs
from anyprobe_train.light.read_windows import read_photo, read_window
from anyprobe_train.light.seen_on_sphere import SeenOnSphere
from anyprobe_train.light.shape import CROP_PX
from anyprobe_train.world.batch import ASSUMED_TANGENT


class LightViews(nn.Module):
    """Given, one photo -> LightInputs of one row, and what the photo shows beside its object, on the sphere
    [4, 64, 128]: RGB times cover, a value above 1 radiance; cover."""

    def __init__(self) -> None:
        super().__init__()
        self.seen = SeenOnSphere()

    def forward(self, given: Given) -> tuple[LightInputs, torch.Tensor]:
        width, height, k, x0, y0, step = given.geometry.unbind()
        longest = torch.maximum(width, height)
        known = (given.lens[1] > 0.5).float()
        half = known * given.lens[0] + (1.0 - known) * ASSUMED_TANGENT
        some, center, side = square_around(given)
        first = (width - longest) / 2.0 / k, (height - longest) / 2.0 / k
        rgb, cover, mask = read_photo(given.photo, first, longest / k, PICTURE_PX).split([3, 1, 1])
        context = torch.cat([rgb, some * mask, cover])[None].clamp(min=0.0)
        start = (center[0] - side / 2.0 - x0) / step, (center[1] - side / 2.0 - y0) / step
        masked = torch.cat([given.window[:3].clamp(max=1.0) * given.window[3:], given.window[3:]])
        crop, picture = (
            (some * read_window(masked, start, (side / step, side / step), px)).clamp(0.0, 1.0)[None]
            for px in (PICTURE_PX, CROP_PX)
        )
        right, down = (2.0 * center - torch.stack([width, height])).unbind()
        scale = some * half / longest
        lens = torch.stack([half, right * scale, -down * scale, side * scale, known])
        seen = self.seen(context, half[None])[0]
        covered = given.panorama[3:]
        panorama = torch.cat([torch.minimum(given.panorama[:3], covered), covered])
        inputs = LightInputs(
            context=context.clamp(max=1.0),
            crop=crop,
            picture=picture,
            seen=(panorama + (1.0 - covered) * seen.clamp(max=1.0))[None],
            lens=lens[None],
            up=given.up[None],
            normals=given_normals(given, NORMALS_SIDE)[None],
            material=given.material[None],
            sun=given.sun[None],
        )
        return inputs, seen


def given_normals(given: Given, size: int) -> torch.Tensor:
    """Return the given normals [3, size, size] over the square around the object, camera frame, unit or zero."""
    some, center, side = square_around(given)
    _, _, _, x0, y0, step = given.geometry.unbind()
    across = torch.ones_like(given.normals[0, 0]).sum() / (step * torch.ones_like(given.window[3, 0]).sum())
    down = torch.ones_like(given.normals[0, :, 0]).sum() / (step * torch.ones_like(given.window[3, :, 0]).sum())
    first = center - side / 2.0
    start = (first[0] - x0) * across, (first[1] - y0) * down
    mean = read_window(given.normals, start, (side * across, side * down), size)
    length = mean.square().sum(dim=0, keepdim=True).sqrt()
    return some * mean / length.clamp(min=SHORTEST) * (length > SHORTEST).float()
