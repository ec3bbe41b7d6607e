"""Light drawn into a map: what is up to white, sources in their size, and what power is left where it is likely."""

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.evaluate.metrics import WITHIN_DEG

POWER_FLOOR = 0.1
"""Power added to the power above white before its logarithm [sr of white]; less than this hardly counts."""
SLOTS = 3
"""Number of sources that are looked for."""
SOURCE_ROWS, PEAK_ROWS = MAP_HEIGHT // 2, MAP_HEIGHT // 4
"""Rows at which a source's place is weighed, and at which its peak is looked for first."""
REACH_DEG, ROUND_DEG = 60.0, 10.0
"""Reach and rounding [degrees] of a place's worth: exp(-sqrt(angle^2 + ROUND_DEG^2) / REACH_DEG) of the probability at
an angle from it, which keeps errors small where much is possible. Chosen on left-out photos."""
PEAK = 12.0
"""Sharpness [1/(1 - cos)] of what counts around a peak."""
SHARP, ROUNDS = 200.0, 3
"""Sharpness of the choice of the peak, and rounds in which it moves to the mean of what counts around it."""
EDGE_DEG = 1.5
"""Half width of a drawn source's soft edge [degrees]: half a pixel."""
LEAST_DEG, MOST_DEG = 2.0, 60.0
"""Radii that sources are drawn with."""
LN_MOST = 9.0
"""Largest logarithm of a power or a radiance."""


class MapDrawing(nn.Module):
    """Place, size and power of sources and all other power -> radiance."""

    solid_angles: torch.Tensor
    angle_of_row: torch.Tensor
    angle_of_column: torch.Tensor
    place_directions: torch.Tensor
    ln_place_angles: torch.Tensor
    peak_directions: torch.Tensor
    ln_peak_angles: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        for name, value in {
            "solid_angles": solid_angles_of(MAP_HEIGHT)[None, None],
            "angle_of_row": (torch.arange(MAP_HEIGHT) + 0.5) * (np.pi / MAP_HEIGHT),
            "angle_of_column": (torch.arange(2 * MAP_HEIGHT) + (0.5 - MAP_HEIGHT)) * (np.pi / MAP_HEIGHT),
            "place_directions": directions_of(SOURCE_ROWS),
            "ln_place_angles": solid_angles_of(SOURCE_ROWS).flatten().log(),
            "peak_directions": directions_of(PEAK_ROWS),
            "ln_peak_angles": solid_angles_of(PEAK_ROWS).flatten().log(),
        }.items():
            self.register_buffer(name, value.contiguous(), persistent=False)

    def places(self, density: torch.Tensor, slots: torch.Tensor) -> torch.Tensor:
        """Return ln of the probability [N, S, 2048] that each source is in a pixel of 32 rows: its own logit
        [N, S, 32, 64] on top of the ln density [N, 1, 64, 128] of all power."""
        logit = F.avg_pool2d(density, 2) + slots
        return torch.log_softmax(logit.flatten(2) + self.ln_place_angles, dim=2)

    def directions(self, places: torch.Tensor, density: torch.Tensor) -> torch.Tensor:
        """Return the unit direction [N, S, 3] around the worthiest of each source's places; of the first one's and of
        all power's, by its ln density [N, 1, 64, 128], together."""
        share = torch.exp(places)
        power = torch.softmax(F.avg_pool2d(density, 2).flatten(2) + self.ln_place_angles, dim=2)
        share = torch.cat([(share[:, :1] + power) / 2, share[:, 1:]], dim=1)
        coarse = 4.0 * F.avg_pool2d(share.unflatten(2, (SOURCE_ROWS, 2 * SOURCE_ROWS)), 2).flatten(2)
        d = self.peak_directions + 0.0 * share[0, 0, 0]  # exports fold nothing of it into a constant of a megabyte
        degrees = torch.acos((d @ d.T).clamp(-1.0, 1.0)) * (180.0 / np.pi)
        worth = coarse @ torch.exp(-torch.sqrt(degrees**2 + ROUND_DEG**2) / REACH_DEG)
        height = SHARP * worth / worth.amax(dim=2, keepdim=True) + self.ln_peak_angles
        peak = F.normalize(torch.softmax(height, dim=2) @ self.peak_directions, dim=2)
        for _ in range(ROUNDS):
            near = share * torch.exp(PEAK * (peak @ self.place_directions.T - 1.0).clamp(min=-1.5))
            peak = F.normalize(near @ self.place_directions, dim=2)
        return peak

    def forward(
        self,
        ln_shown: torch.Tensor,
        ln_power: torch.Tensor,
        density: torch.Tensor,
        directions: torch.Tensor,
        exists: torch.Tensor,
        ln_radius: torch.Tensor,
        ln_powers: torch.Tensor,
        places: torch.Tensor,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return radiance [N, 3, 64, 128] with sources in their size, and with all power by its density.

        The first source is drawn, and others that are likelier than not to be where they are drawn; these get the
        power of all.
        """
        shown, above = torch.exp(ln_shown.clamp(max=0.0)), power_of(ln_power)
        spread = torch.exp(density - density.amax(dim=(2, 3), keepdim=True))
        disc = self.discs(directions, ln_radius)  # [N, S, 8192]
        is_drawn = self.is_there(places, directions, exists)
        powers = torch.sigmoid(exists)[..., None] * power_of(ln_powers)
        whole, powers = powers.sum(dim=1, keepdim=True), powers * is_drawn[..., None]
        powers = powers * (whole / powers.sum(dim=1, keepdim=True).clamp(min=1e-6))
        scale = (above / powers.sum(dim=1).clamp(min=1e-6)).clamp(max=1.0)
        powers = powers * scale[:, None]
        sources = (powers.transpose(1, 2) @ self._even(disc)).unflatten(2, (MAP_HEIGHT, 2 * MAP_HEIGHT))
        covered = ((is_drawn * torch.sigmoid(exists))[..., None] * disc).amax(dim=1, keepdim=True)
        rest = spread * (1.0 - covered).unflatten(2, (MAP_HEIGHT, 2 * MAP_HEIGHT))
        left = (above - powers.sum(dim=1)).clamp(min=0.0)[:, :, None, None]
        expected = shown + above[:, :, None, None] * self._shares(spread)
        return shown + sources + left * self._shares(rest), expected

    def is_there(self, places: torch.Tensor, directions: torch.Tensor, exists: torch.Tensor) -> torch.Tensor:
        """Return 1 for the first source and for those that are likelier than not to exist within WITHIN_DEG of their
        direction, else 0: [N, S]."""
        others = (self.likely(places, directions, exists, WITHIN_DEG)[:, 1:] > 0.5).float()
        return torch.cat([torch.ones_like(others[:, :1]), others], dim=1)

    def likely(
        self, places: torch.Tensor, directions: torch.Tensor, exists: torch.Tensor, within_deg: float
    ) -> torch.Tensor:
        """Return the probability that each source exists and is within an angle of its direction, [N, S]."""
        near = (directions @ self.place_directions.T > float(np.cos(np.radians(within_deg)))).float()
        return torch.sigmoid(exists) * (torch.exp(places) * near).sum(dim=2)

    def discs(self, directions: torch.Tensor, ln_radius: torch.Tensor) -> torch.Tensor:
        """Return how much of each map pixel each source covers [N, S, 8192], with a soft edge."""
        radius = torch.exp(ln_radius).clamp(LEAST_DEG, MOST_DEG)[..., None]
        x, y, z = directions[..., None, None].unbind(dim=2)  # [N, S, 1, 1]
        level = x * torch.sin(self.angle_of_column) - z * torch.cos(self.angle_of_column)
        row = self.angle_of_row[:, None]
        cosine = (torch.sin(row) * level + torch.cos(row) * y).flatten(2).clamp(-1 + 1e-6, 1 - 1e-6)
        degrees = torch.acos(cosine) * (180.0 / np.pi)
        return ((radius + EDGE_DEG - degrees) / (2 * EDGE_DEG)).clamp(0.0, 1.0)

    def _even(self, disc: torch.Tensor) -> torch.Tensor:
        """Scale pictures [N, S, 8192] so that their integral is 1."""
        total = (disc * self.solid_angles.flatten()).sum(dim=2, keepdim=True)
        return disc / total.clamp(min=1e-6)

    def _shares(self, spread: torch.Tensor) -> torch.Tensor:
        return spread / (spread * self.solid_angles).sum(dim=(2, 3), keepdim=True).clamp(min=1e-9)


def directions_of(rows: int) -> torch.Tensor:
    """Return unit directions [2 rows^2, 3] of a map's pixels."""
    return torch.from_numpy(pixel_directions(rows)).float().flatten(0, 1)


def pictured_directions(rows: int) -> torch.Tensor:
    """Return unit directions [1, 3, rows, 2 rows] of a map's pixels."""
    return directions_of(rows).T.unflatten(1, (rows, 2 * rows))[None].contiguous()


def solid_angles_of(rows: int) -> torch.Tensor:
    """Return the solid angles [rows, 2 rows] of a map's pixels."""
    return torch.from_numpy(pixel_solid_angles(rows)).float().expand(-1, 2 * rows)


def power_of(ln_power: torch.Tensor) -> torch.Tensor:
    """Return power from its logarithm with POWER_FLOOR."""
    return (torch.exp(ln_power.clamp(max=LN_MOST)) - POWER_FLOOR).clamp(min=0.0)
