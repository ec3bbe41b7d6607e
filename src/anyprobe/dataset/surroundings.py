"""What else a photo shows: the part of the map around the object that lies inside the picture's frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.latlong import pixel_directions

GROW = 4
"""Pixels of the crop around the object that are left out: its edge is not where the mask says."""
ASPECTS = (4 / 3, 3 / 2, 16 / 9)
TURN_COLUMNS = 2
"""Columns of the map (2.8 degrees) that the surroundings are off by at most: they are not as far as the light."""
GAIN_STOPS = 0.1
"""Standard deviation of what they are brighter by in the photo, by vignetting and the like."""


def draw_frame(rng: np.random.Generator, tan_half: float) -> np.ndarray:
    """A picture's frame around a crop: least x, greatest x, least y, greatest y on the plane z = -1 before the eye.

    Longer side 45 to 80 degrees wide, upright or across; the crop, [-tan_half, tan_half] both ways, anywhere in it.
    """
    half = np.tan(np.radians(rng.uniform(45.0, 80.0)) / 2) / np.array([1.0, rng.choice(ASPECTS)])
    half = np.maximum(half[:: rng.choice([1, -1])], tan_half)
    center = rng.uniform(-1, 1, 2) * (half - tan_half)
    return np.stack([center - half, center + half], axis=-1).ravel()


def photo_around(
    light: torch.Tensor,
    mask: torch.Tensor,
    tan_half: torch.Tensor,
    frames: np.ndarray,
    tone: Callable[[torch.Tensor], torch.Tensor],
) -> torch.Tensor:
    """The map as far as a photo shows it, [B, 4, H, 2H]: display RGB times cover, and cover in [0, 1].

    Args:
        light: [B, 3, H, 2H] in the crop's frame and exposure units, with the photo's white balance.
        mask: [B, 1, S, S] of the object in the crop, whose side takes in tan_half [B] to either side.
        frames: [B, 4] of draw_frame; an empty one shows nothing.
        tone: the cameras' response.
    """
    d = torch.from_numpy(pixel_directions(light.shape[2])).to(light.device)
    depth = -d[..., 2].clip(max=-0.05)
    plane = torch.stack([d[..., 0], d[..., 1]], dim=-1) / depth[..., None]  # [H, 2H, 2]
    x0, x1, y0, y1 = torch.from_numpy(np.asarray(frames, np.float32)).to(light.device).T[..., None, None]
    x, y = plane.unbind(dim=-1)
    inside = (d[..., 2] < -0.05) & (x > x0) & (x < x1) & (y > y0) & (y < y1)
    on_crop = plane * torch.tensor([1.0, -1.0], device=light.device) / tan_half.reshape(-1, 1, 1, 1)
    grown = F.max_pool2d(mask, 2 * GROW + 1, 1, GROW)
    hidden = F.grid_sample(grown, on_crop, mode="bilinear", align_corners=False)
    cover = inside[:, None] * (1 - hidden)
    display = (tone(light).clip(0.0, 1.0) * 255).round() / 255
    return torch.cat([display * cover, cover], dim=1)


def unsteady(light: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Maps [B, 3, H, 2H] a little turned about the vertical and a little too bright or dark, each in its own way."""
    turns = rng.integers(-TURN_COLUMNS, TURN_COLUMNS + 1, len(light))
    gains = np.exp2(rng.normal(0.0, GAIN_STOPS, len(light)))
    return torch.stack(
        [
            torch.roll(one, int(turn), dims=2) * float(gain)
            for one, turn, gain in zip(light, turns, gains, strict=True)
        ]
    )
