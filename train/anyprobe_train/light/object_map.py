"""The map that an object alone shows, for photos in which nothing beside it is to be believed.

A pixel of a smooth object shows mostly the light of its mirror direction. Moved there, pixels of the photo become
pixels of the map, and only the gaps remain to be completed.
"""

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import direction_to_uv
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.scatter.materials import MATERIAL_INPUTS
from anyprobe_train.light.drawing import pictured_directions
from anyprobe_train.light.shape import turned_back
from anyprobe_train.nets.blocks import UpBlock, conv, two_layers, wrap

OBJECT_WIDTHS, SPHERE_WIDTHS = (16, 32, 64, 128, 192), (24, 48, 96, 128)
FEATURES, CODE = 8, 192
"""Channels that are lifted beside colours, and numbers that say the whole object."""
COLORS = 6
"""Channels lifted at full size: photo and irradiance."""
MARGIN = 8
"""Columns repeated beyond the seam at 32 rows."""
LAID = 48
"""Channels at four rows that the code is laid on."""
MEAN_LN, LN_SCALE = -1.2, 2.0
"""ln radiance of an answer of zero, and of an answer of one above it."""


class ObjectMap(nn.Module):
    """Radiance up to white [N, 3, 64, 128] in the camera's frame, see forward."""

    directions: torch.Tensor
    coarse_directions: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        pairs = list(zip(OBJECT_WIDTHS[:-1], OBJECT_WIDTHS[1:], strict=True))
        first, last = OBJECT_WIDTHS[0], OBJECT_WIDTHS[-1]
        self.first = nn.Sequential(conv(4 * 4 + 6, first), conv(first, first))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.material = two_layers(MATERIAL_INPUTS, last)
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(last * 16, CODE), nn.LeakyReLU(0.1))
        self.root_alpha = nn.Linear(CODE, 1)
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(first, 3 * 4 + 1 + FEATURES, 3, padding=1)
        pairs, fine = list(zip(SPHERE_WIDTHS[:-1], SPHERE_WIDTHS[1:], strict=True)), SPHERE_WIDTHS[0]
        lifted = COLORS + FEATURES + 1
        self.start = nn.Sequential(nn.Linear(CODE + 1, LAID * 4 * 8), nn.LeakyReLU(0.1))
        self.enter = nn.Sequential(conv(4 * (COLORS + 1) + lifted + 3, fine), conv(fine, fine))
        self.coarser = nn.ModuleList(conv(a, b, stride=2) for a, b in pairs)
        self.seen = nn.ModuleList(conv(b + lifted + (LAID if b == SPHERE_WIDTHS[-1] else 0), b) for _, b in pairs)
        self.finer = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.last = nn.Conv2d(fine, 4 * 3, 3, padding=1)
        self.register_buffer("directions", pictured_directions(MAP_HEIGHT), persistent=False)
        self.register_buffer("coarse_directions", wrap(pictured_directions(MAP_HEIGHT // 2), MARGIN), persistent=False)

    def forward(
        self,
        picture: torch.Tensor,
        frame: tuple[torch.Tensor, torch.Tensor, torch.Tensor],
        normals: torch.Tensor,
        given: torch.Tensor,
        material: torch.Tensor,
    ) -> torch.Tensor:
        """Answer.

        Args:
            picture: [N, 4, 128, 128] the crop, RGB x mask, mask.
            frame: its CropFrame.
            normals, given: [N, 3, 64, 64] unit, in that frame, and [N, 1, 64, 64] where they are known.
            material: [N, 8], zero where not known.
        """
        ray, slope, wo = frame
        shown = torch.cat([F.pixel_unshuffle(picture, 2), slope, normals, given], dim=1)
        levels = [self.first(shown.contiguous(memory_format=torch.channels_last))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop() + self.material(material)[:, :, None, None]
        code = self.code(x.contiguous())
        code = torch.cat([code, torch.sigmoid(self.root_alpha(code))], dim=1)
        for up in self.up:
            x = up(x, levels.pop())
        residual, weight, features = self.head(x).split([12, 1, FEATURES], dim=1)
        with torch.autocast(x.device.type, enabled=False):
            mask = picture[:, 3:]
            irradiance = (picture[:, :3] + F.pixel_shuffle(residual.float(), 2)) * mask
            cover = F.avg_pool2d(mask, 2)
            colors = [F.avg_pool2d(one, 2) / (cover + 1e-4) for one in (picture[:, :3], irradiance)]
            wi = 2.0 * (normals * wo).sum(dim=1, keepdim=True) * normals - wo
            lifted = lifted_means(
                torch.cat([*colors, features.float()], dim=1), torch.sigmoid(weight.float()) * cover, wi
            )
        out = self._completed(lifted, code)
        with torch.autocast(x.device.type, enabled=False):
            radiance = torch.exp((LN_SCALE * out.float() + MEAN_LN).clamp(max=0.0))
            uv = direction_to_uv(turned_back(self.directions, ray).permute(0, 2, 3, 1))
            across = (uv[..., :1] * (2 * MAP_HEIGHT) + 1.0) / (MAP_HEIGHT + 1.0) - 1.0  # of the map and its border
            at = torch.cat([across, 2.0 * uv[..., 1:] - 1.0], dim=3)
            return F.grid_sample(wrap(radiance, 1), at, padding_mode="border", align_corners=False)

    def _completed(self, lifted: list[torch.Tensor], code: torch.Tensor) -> torch.Tensor:
        """Complete the lifted means at 64 to 4 rows to [N, 3, 64, 128]."""
        fine, *rest = lifted
        known = F.pixel_unshuffle(wrap(torch.cat([fine[:, :COLORS], fine[:, -1:]], dim=1), 2 * MARGIN), 2)
        directions = self.coarse_directions.expand(len(code), -1, -1, -1)
        levels = [self.enter(torch.cat([known, wrap(rest[0], MARGIN), directions], dim=1))]
        start = self.start(code).unflatten(1, (LAID, 4, 8))
        for depth, (down, seen) in enumerate(zip(self.coarser, self.seen, strict=True), start=1):
            parts = [down(levels[-1]), wrap(rest[depth], MARGIN >> depth)]
            if depth == len(self.coarser):
                parts.append(wrap(start, MARGIN >> depth))
            levels.append(seen(torch.cat(parts, dim=1)))
        x = levels.pop()
        for up in self.finer:
            x = up(x, levels.pop())
        return _joined(F.pixel_shuffle(self.last(x), 2), 2 * MARGIN)


def lifted_means(values: torch.Tensor, weight: torch.Tensor, wi: torch.Tensor) -> list[torch.Tensor]:
    """Return weighted means of values [N, C, S, S] by the pixel of a map that wi [N, 3, S, S] falls in, at 64, 32, 16,
    8 and 4 rows [N, C + 1, H, 2H]; the last channel says how much of the object there is, in [0, 1)."""
    uv = direction_to_uv(wi.detach().flatten(2).transpose(1, 2))
    column = (uv[..., 0] * (2 * MAP_HEIGHT)).floor().long().clamp(0, 2 * MAP_HEIGHT - 1)  # in integers: no NaN is left
    row = (uv[..., 1] * MAP_HEIGHT).floor().long().clamp(0, MAP_HEIGHT - 1)
    carried = torch.cat([values * weight, weight], dim=1).flatten(2)
    nothing = (0.0 * carried[..., :1]).expand(-1, -1, 2 * MAP_HEIGHT**2)  # exports keep no megabyte of zeros
    sums = nothing.scatter_add(2, (row * (2 * MAP_HEIGHT) + column)[:, None].expand_as(carried), carried)
    sums = sums.unflatten(2, (MAP_HEIGHT, 2 * MAP_HEIGHT))
    means = []
    for _ in range(5):
        there = sums[:, -1:]
        means.append(torch.cat([sums[:, :-1] / (there + 1e-3), there / (there + 0.3)], dim=1))
        sums = F.avg_pool2d(sums, 2) * 4
    return means


def _joined(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Undo wrap; the columns computed on both sides are blended, so that no seam shows."""
    left, core, right = x.split([columns, x.shape[3] - 2 * columns, columns], dim=3)
    first, middle, last = core.split([columns, core.shape[3] - 2 * columns, columns], dim=3)
    fade = 0.5 - (torch.arange(columns, dtype=x.dtype, device=x.device) + 0.5) / (2 * columns)  # 0.5 to 0
    return torch.cat([first + fade * (right - first), middle, last + fade.flip(0) * (left - last)], dim=3)
