"""MapViews (noun): endless views of maps through cameras of random curve, which the paper's HDR network learns from.

Each is a pair of `pair.render_map_pair` (Sect. 3.5: maps x 23 views x 5 exposures) to rounding, but made in
milliseconds: a viewpoint is a tilt, of which there are 23 tables, and a yaw, which shifts the map along its rows; and
several cameras see one view, as in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.dataset.camera import Shot, draw_shot, exposure_for_clipping
from anyprobe.dataset.pair import LN_RANGE, fibonacci_viewpoint
from anyprobe.dataset.pairs import PairConfig, curves
from anyprobe.dataset.recipe import EXPOSURES, VIEWPOINTS
from anyprobe.light.environment import MAP_HEIGHT

FINE = 4
"""A pixel of a view is the mean of so many directions along either side, as where pairs are lit."""
CLIPPED = (0.05, 0.15)
"""Share of the sphere that a camera clips (hdrcnn), before the exposure's 0.5 to 2."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MapBatch:
    """ldr [B, 3, 64, 128] through each view's own curve, in steps of 1/255; ln_radiance [B, 3, 64, 128] in its
    units: a radiance of 1 is white under every curve."""

    ldr: torch.Tensor
    ln_radiance: torch.Tensor

    def to(self, device: str) -> MapBatch:
        """The same on another device."""
        return MapBatch(ldr=self.ldr.to(device), ln_radiance=self.ln_radiance.to(device))


class MapViews:
    """Endless batches; `batch(k)` for consecutive k is fast.

    Of a PairConfig: reuse is how many cameras see a view, pool how many groups of so many views are kept in a lane.
    """

    def __init__(self, maps: Sequence[np.ndarray], config: PairConfig, device: str = "cpu") -> None:
        self.config, self.device = config, device
        self._maps = [_wide(radiance) for radiance in maps]
        self._places = torch.stack([_places(view) for view in range(VIEWPOINTS)])  # [23, 256, 512, 2]
        rows = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT * FINE))
        self._weight = rows / rows.reshape(-1, FINE).mean(dim=1).repeat_interleave(FINE)[:, None]
        self._group = lru_cache(maxsize=config.pool * config.lanes)(self._draw_group)
        self._steps_per_group = max(1, config.group * config.reuse // config.batch)

    @torch.no_grad()
    def batch(self, step: int) -> MapBatch:
        """The views of step number `step`, each through a camera and at an exposure of its own."""
        config = self.config
        turn, lane = divmod(step, config.lanes)
        first = turn // self._steps_per_group
        pool = [light for k in range(first, first + config.pool) for light in self._group(lane, k)]
        rng = np.random.default_rng((config.seed, 4, step))
        chosen = rng.choice(len(pool), config.batch, replace=len(pool) < config.batch)
        exposed = [expose(pool[k], int(rng.integers(EXPOSURES)), rng) for k in chosen]
        light = torch.stack([light for light, _ in exposed])
        ldr = response(light, curves([shot for _, shot in exposed], "cpu"))
        made = MapBatch(
            ldr=(ldr * 255.0).round() / 255.0,
            ln_radiance=torch.log(light.clip(min=1e-6)).clip(*LN_RANGE),
        )
        return made.to(self.device)

    def _draw_group(self, lane: int, index: int) -> list[torch.Tensor]:
        """Random maps from random viewpoints, half of them mirrored."""
        rng = np.random.default_rng((self.config.seed, 3, lane, index))
        drawn = []
        for _ in range(self.config.group):
            which, view = int(rng.integers(len(self._maps))), int(rng.integers(VIEWPOINTS))
            drawn.append(self.look(which, view, rng.uniform(0, 2 * np.pi), mirrored=rng.random() < 0.5))
        return drawn

    def look(self, which: int, view: int, yaw: float, mirrored: bool = False) -> torch.Tensor:
        """Map number `which` as a camera at this yaw and a viewpoint's elevation sees it, [3, 64, 128]; mirrored left
        to right if asked."""
        wide, places = self._maps[which], self._places[view]
        u = torch.remainder(places[..., 0] - yaw / (2 * np.pi), 1.0)
        x = (u * (wide.shape[2] - 2) + 1.0) / wide.shape[2] * 2.0 - 1.0
        place = torch.stack([x, places[..., 1] * 2.0 - 1.0], dim=-1)
        fine = F.grid_sample(wide[None], place[None], padding_mode="border", align_corners=False)
        light = F.avg_pool2d(fine * self._weight, FINE)[0]
        return light.flip(2) if mirrored else light


def expose(light: torch.Tensor, number: int, rng: np.random.Generator) -> tuple[torch.Tensor, Shot]:
    """A view [3, 64, 128] in the units of a random camera at exposure `number`, and that camera.

    rng: draws what a recipe's does after the yaw, in the same order.
    """
    shot = draw_shot(rng, conditions=0)
    gain = exposure_for_clipping(luminance(light.permute(1, 2, 0).numpy()), rng.uniform(*CLIPPED))
    gain *= 0.5 * 4.0 ** ((number + rng.random()) / EXPOSURES)
    return light * torch.from_numpy(np.float32(gain * shot.white_balance))[:, None, None], shot


def _wide(radiance: np.ndarray) -> torch.Tensor:
    """A map [H, 2H, 3] as planes [3, H, 2H + 2], a column beyond the seam on both sides."""
    planes = torch.from_numpy(np.ascontiguousarray(radiance, np.float32)).permute(2, 0, 1)
    return torch.cat([planes[..., -1:], planes, planes[..., :1]], dim=2)


def _places(view: int) -> torch.Tensor:
    """Where a camera of yaw 0 at a viewpoint's elevation sees its fine pixels, map coordinates [256, 512, 2]."""
    _, elevation = fibonacci_viewpoint(view)
    map_from_camera = world_from_camera(0.0, elevation).astype(np.float32)
    directions = pixel_directions(MAP_HEIGHT * FINE) @ map_from_camera.T
    return torch.from_numpy(direction_to_uv(directions).astype(np.float32))
