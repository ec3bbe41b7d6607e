"""What else a photo shows: the part of the map around the object that lies inside the picture's frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.latlong import pixel_directions
from anyprobe.dataset.ground_plane import Scenes

GROW = 4
"""Pixels of the crop around the object that are left out: its edge is not where the mask says."""
ASPECTS = (4 / 3, 3 / 2, 16 / 9)
TURN_COLUMNS = 2
"""Columns of the map (2.8 degrees) that the surroundings are off by at most: they are not as far as the light."""
GAIN_STOPS = 0.1
"""Standard deviation of what they are brighter by in the photo, by vignetting and the like."""
PITCH_ERROR_DEG, ROLL_ERROR_DEG = 2.5, 1.0
"""Standard deviations of what the camera's pitch and roll are wrong by where the ground is placed."""
PLACE_ERROR = 0.12
"""Of the logarithm of the object's distance in heights of its centre, and of that centre in such heights."""
LEAST_SINE = 0.02
"""Of the angle below the horizon from which on a direction is taken to meet the ground."""
FAR = 0.7
"""Share of photos of which the ground is shown as if it were as far as the light, as the estimator does it."""
FILLED = 0.8
"""Share of photos in which what is not seen of the ground is given its middle colour."""
MOST_OTHERS = 7
"""Photos beside the one, of which surroundings may be gathered."""
PITCH_DEG = 10.0
"""Standard deviation of how far up or down the others look."""


def draw_frame(rng: np.random.Generator, tan_half: float) -> np.ndarray:
    """A picture's frame around a crop: least x, greatest x, least y, greatest y on the plane z = -1 before the eye.

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
) -> torch.Tensor:
    """The map as far as a photo shows it, [B, 4, H, 2H]: display RGB times cover, and cover in [0, 1].

    Args:
        light: [B, 3, H, 2H] in the crop's frame and exposure units, with the photo's white balance.
        mask: [B, 1, S, S] of the object in the crop, whose side takes in tan_half [B] to either side.
        frames: [B, 4] of draw_frame; an empty one shows nothing.
        tone: the cameras' response.
    """
    return _shown(light, mask, tan_half, frames, np.broadcast_to(np.eye(3), (len(light), 3, 3)), tone)


def ground_surroundings(
    scenes: Scenes,
    mask: torch.Tensor,
    tan_half: torch.Tensor,
    frames: np.ndarray,
    rng: np.random.Generator,
    shown: Callable[[torch.Tensor], torch.Tensor],
) -> torch.Tensor:
    """photo_surroundings where the object stands on a ground that the photo shows: each of its pixels at the direction
    that it has from the object's centre, as the camera's pitch and roll and where the object stands say, all a little
    wrong; what is not seen of it may have the middle colour of what is.

    Args:
        shown: of radiance [B, 3, ...] along rays: the photo's display values.
    """
    count, height = len(mask), scenes.base.shape[2]
    device = mask.device
    errors = rng.normal(0.0, np.radians([PITCH_ERROR_DEG, ROLL_ERROR_DEG]), (count, 2))
    turns = np.stack([rotation_x(pitch) @ rotation_z(roll) for pitch, roll in errors]).astype(np.float32)
    up = torch.einsum("bij,bj->bi", torch.from_numpy(turns).to(device), scenes.up())
    place = rng.normal(0.0, PLACE_ERROR, (count, 4)).astype(np.float32)
    center = scenes.center * torch.from_numpy(np.exp(place[:, :1])).to(device) + torch.from_numpy(place[:, 1:]).to(
        device
    )
    d = torch.from_numpy(pixel_directions(height)).to(device)  # [H, 2H, 3]
    down = -torch.einsum("hwi,bi->bhw", d, up)
    below = down > LEAST_SINE
    point = center[:, None, None] + d / down.clip(min=LEAST_SINE)[..., None]
    far = torch.from_numpy(rng.random(count) < FAR).to(device)
    below &= ~far[:, None, None]
    rays = F.normalize(torch.where(below[..., None], point, d.expand(count, -1, -1, -1)), dim=-1)
    cover = inside_frame(rays, frames)[:, None] * (1 - _hidden(rays, mask, tan_half))
    display = (shown(scenes.see(rays)).clip(0.0, 1.0) * 255).round() / 255
    result = torch.cat([display * cover, cover], dim=1)
    for one in np.nonzero(rng.random(count) < FILLED)[0]:
        seen = below[one] & (cover[one, 0] > 0.5)
        if seen.any():
            color = display[one][:, seen].median(dim=1).values
            free = below[one] * (1 - cover[one, 0])
            result[one] += free * torch.cat([color, color.new_ones(1)])[:, None, None]
    return result


def gather(
    surroundings: torch.Tensor,
    light: torch.Tensor,
    mask: torch.Tensor,
    tan_half: torch.Tensor,
    chosen: np.ndarray,
    rng: np.random.Generator,
    tone: Callable[[torch.Tensor], torch.Tensor],
) -> torch.Tensor:
    """What photos show, of photo_surroundings, and where they show nothing what other photos of the same object do.

    Their cameras went round it; each shows the map a little off in its own way.

    Args:
        chosen: [B], which photos come with 1 to MOST_OTHERS others.
        light, mask, tan_half, tone: of photo_surroundings; the mask stands for the object as the others see it.
    """
    counts = rng.integers(1, MOST_OTHERS + 1, len(chosen)) * chosen
    for number in range(counts.max(initial=0)):
        turns = np.stack([_turn_round(rng) for _ in chosen])
        frames = np.stack([draw_frame(rng, each) for each in tan_half.tolist()])
        frames *= (counts > number)[:, None]
        others = _shown(unsteady(light, rng), mask, tan_half, frames, turns, tone)
        surroundings = surroundings + (1 - surroundings[:, 3:]) * others
    return surroundings


def _turn_round(rng: np.random.Generator) -> np.ndarray:
    """map_from_other [3, 3] of a camera somewhere else round the object, about as high as the first."""
    turn = rotation_y(rng.uniform(-np.pi, np.pi)) @ rotation_x(np.radians(rng.normal(0.0, PITCH_DEG)))
    return turn.astype(np.float32)


def _shown(
    light: torch.Tensor,
    mask: torch.Tensor,
    tan_half: torch.Tensor,
    frames: np.ndarray,
    map_from_photo: np.ndarray,
    tone: Callable[[torch.Tensor], torch.Tensor],
) -> torch.Tensor:
    """photo_surroundings of cameras that were turned by map_from_photo [B, 3, 3]."""
    device = mask.device
    turns = torch.from_numpy(np.asarray(map_from_photo, np.float32)).to(device)
    d = torch.from_numpy(pixel_directions(light.shape[2])).to(device) @ turns[:, None]  # as rows: in the photos' frames
    cover = inside_frame(d, frames)[:, None] * (1 - _hidden(d, mask, tan_half))
    display = (tone(light).clip(0.0, 1.0) * 255).round() / 255
    return torch.cat([display * cover, cover], dim=1)


def _on_plane(d: torch.Tensor) -> torch.Tensor:
    """Directions [..., 3] on the plane z = -1 before the eye, [..., 2]."""
    return d[..., :2] / -d[..., 2:].clip(max=-0.05)


def inside_frame(d: torch.Tensor, frames: np.ndarray) -> torch.Tensor:
    """Which directions [B, H, W, 3] the photos' frames [B, 4] of draw_frame take in."""
    x0, x1, y0, y1 = torch.from_numpy(np.asarray(frames, np.float32)).to(d.device).T[..., None, None]
    x, y = _on_plane(d).unbind(dim=-1)
    return (d[..., 2] < -0.05) & (x > x0) & (x < x1) & (y > y0) & (y < y1)


def _hidden(d: torch.Tensor, mask: torch.Tensor, tan_half: torch.Tensor) -> torch.Tensor:
    """How much of each direction [B, H, W, 3] the object hides, its edge counted to it, [B, 1, H, W]."""
    on_crop = _on_plane(d) * d.new_tensor([1.0, -1.0]) / tan_half.reshape(-1, 1, 1, 1)
    side = 2 * GROW + 1
    grown = F.max_pool2d(F.max_pool2d(mask, (side, 1), 1, (GROW, 0)), (1, side), 1, (0, GROW))
    return F.grid_sample(grown, on_crop, mode="bilinear", align_corners=False)


def unsteady(light: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Maps [B, 3, H, 2H] a little turned about the vertical and a little too bright or dark, each in its own way."""
    turns = rng.integers(-TURN_COLUMNS, TURN_COLUMNS + 1, len(light))
    gains = np.exp2(rng.normal(0.0, GAIN_STOPS, len(light)))
    return torch.stack(
        [torch.roll(one, int(turn), dims=2) * float(gain) for one, turn, gain in zip(light, turns, gains, strict=True)]
    )
