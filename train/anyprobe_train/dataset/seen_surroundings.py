"""Visible surroundings: the part of the map around the object that lies inside the picture's frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions

GROW = 4
"""Margin around the object that is left out [pixels of the crop], as the mask's edge is uncertain."""
ASPECTS = (4 / 3, 3 / 2, 16 / 9)
TURN_COLUMNS = 2
"""Largest rotation error of the surroundings [columns of the map, of 2.8 degrees]: they are nearer than the light."""
GAIN_STOPS = 0.1
"""Standard deviation of their brightness error in the photo [stops], by vignetting and the like."""
MAX_OTHERS = 7
"""Largest number of additional photos whose surroundings are merged."""
PITCH_DEG = 10.0
"""Standard deviation of the other cameras' pitch [degrees]."""


def draw_frame(rng: np.random.Generator, tan_half: float) -> np.ndarray:
    """Draw a picture's frame around a crop: x and y, least and greatest, on the plane z = -1 before the eye.

    Longer side 45 to 80 degrees wide, upright or across; the crop, [-tan_half, tan_half] both ways, anywhere in it.
    """
    half = np.tan(np.radians(rng.uniform(45.0, 80.0)) / 2) / np.array([1.0, rng.choice(ASPECTS)])
    half = np.maximum(half[:: rng.choice([1, -1])], tan_half)
    center = rng.uniform(-1, 1, 2) * (half - tan_half)
    return np.stack([center - half, center + half], axis=-1).ravel()


def photo_surroundings(
    light: torch.Tensor,
    mask: torch.Tensor,
    tan_half: torch.Tensor,
    frames: np.ndarray,
    tone: Callable[[torch.Tensor], torch.Tensor],
    map_from_photo: np.ndarray | None = None,
) -> torch.Tensor:
    """Render the part of the map that a photo shows, [B, 4, H, 2H]: display RGB times cover, and cover in [0, 1].

    Args:
        light: [B, 3, H, 2H] in the crop's frame and exposure units, with the photo's white balance.
        mask: [B, 1, S, S] of the object in the crop, whose side takes in tan_half [B] to either side.
        frames: [B, 4] of draw_frame; an empty one shows nothing.
        tone: the cameras' response.
        map_from_photo: [B, 3, 3], how the cameras are rotated; None: not at all.
    """
    device = mask.device
    turns = torch.eye(3)[None] if map_from_photo is None else torch.from_numpy(map_from_photo).float()
    d = torch.from_numpy(pixel_directions(light.shape[2])).to(device)
    d = d @ turns.to(device)[:, None]  # as rows: in the photos' frames
    plane = d[..., :2] / -d[..., 2:].clip(max=-0.05)  # [B, H, 2H, 2]
    x0, x1, y0, y1 = torch.from_numpy(np.asarray(frames, np.float32)).to(device).T[..., None, None]
    x, y = plane.unbind(dim=-1)
    inside = (d[..., 2] < -0.05) & (x > x0) & (x < x1) & (y > y0) & (y < y1)
    on_crop = plane * d.new_tensor([1.0, -1.0]) / tan_half.reshape(-1, 1, 1, 1)
    side = 2 * GROW + 1
    grown = F.max_pool2d(F.max_pool2d(mask, (side, 1), 1, (GROW, 0)), (1, side), 1, (0, GROW))
    hidden = F.grid_sample(grown, on_crop, mode="bilinear", align_corners=False)
    cover = inside[:, None] * (1 - hidden)
    display = (tone(light).clip(0.0, 1.0) * 255).round() / 255
    return torch.cat([display * cover, cover], dim=1)


def gather(
    surroundings: torch.Tensor,
    light: torch.Tensor,
    mask: torch.Tensor,
    tan_half: torch.Tensor,
    chosen: np.ndarray,
    rng: np.random.Generator,
    tone: Callable[[torch.Tensor], torch.Tensor],
) -> torch.Tensor:
    """Merge the surroundings of photos with those of other photos of the same object, where the first show none.

    Their cameras went round it; each shows the map a little off in its own way.

    Args:
        chosen: [B], which photos come with 1 to MAX_OTHERS others.
        light, mask, tan_half, tone: of photo_surroundings; the mask stands for the object as the others see it.
    """
    counts = rng.integers(1, MAX_OTHERS + 1, len(chosen)) * chosen
    for number in range(counts.max(initial=0)):
        turns = np.stack([_turn_round(rng) for _ in chosen])
        frames = np.stack([draw_frame(rng, photo_tan_half) for photo_tan_half in tan_half.tolist()])
        frames *= (counts > number)[:, None]
        others = photo_surroundings(perturb(light, rng), mask, tan_half, frames, tone, turns)
        surroundings = surroundings + (1 - surroundings[:, 3:]) * others
    return surroundings


def _turn_round(rng: np.random.Generator) -> np.ndarray:
    """Draw map_from_other [3, 3] of a camera somewhere else round the object, about as high as the first."""
    turn = rotation_y(rng.uniform(-np.pi, np.pi)) @ rotation_x(np.radians(rng.normal(0.0, PITCH_DEG)))
    return turn.astype(np.float32)


def perturb(light: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Rotate each map [B, 3, H, 2H] a little about the vertical and change its brightness a little."""
    turns = rng.integers(-TURN_COLUMNS, TURN_COLUMNS + 1, len(light))
    gains = np.exp2(rng.normal(0.0, GAIN_STOPS, len(light)))
    changes = zip(light, turns.tolist(), gains.tolist(), strict=True)
    return torch.stack([torch.roll(radiance, turn, dims=2) * gain for radiance, turn, gain in changes])
