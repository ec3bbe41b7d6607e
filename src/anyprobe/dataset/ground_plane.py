"""What an object stands on: a table or a floor below it, lit by the map's upper half, with the object's shadow.

Everything is in the frame of the map (+Y up) and in units of the height of the object's centre above the ground, so
that a point of the ground is q = (x, z) from the foot below that centre, and the direction d from the centre meets it
at q = (d_x, d_z) / -d_y. Ground radiance is albedo(q) E(q) / pi; E without the object is that of the upper half of the
map, and with it a sum over directions drawn from the map by importance, each with its own sharp shadow.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import luminance
from anyprobe.core.latlong import direction_to_uv, pixel_directions, pixel_solid_angles, uv_to_direction
from anyprobe.dataset import distributions
from anyprobe.light.environment import shrink

WAVES = 6
"""Plane waves that make a ground's pattern."""
FOOTPRINT = np.pi / 256
"""Angle that a pixel takes in: waves that it cannot show are faded out."""
ENDLESS = 0.35
"""Share of grounds that reach to the horizon; the rest are tables."""
HALF_SIDES = (3.0, 40.0)
"""Range of a table's half sides, and least distance of its edge from the object."""
LEAST_TO_EDGE = 1.6
DIRECTIONS = 48
"""Directions in which the ground is lit."""
SAMPLED_ROWS = 128
"""Of the map that they are drawn from, at most."""
GROUND_GRID = 64
"""Side of the picture of the shadow."""
REACH = 3.5
"""Half of that side, in radii of the object's outline as seen from above, or heights of its centre if that is more."""
LEAST_SINE = 0.04
"""Of the elevation of light that casts a shadow: lower light is nearly level and hardly lights the ground."""
OWN_SHADOW = 0.6
"""Squared radius of the sphere, in heights of its centre, that darkens the ground as the object itself sees it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Grounds:
    """B grounds. albedo [B, 3]; waves [B, W, 2], phases [B, W] and amplitudes [B, W, 3] of ln albedo; the table's sides
    lie at turn [B] (radians), its middle [B, 2] and half_sides [B, 2] are along them."""

    albedo: torch.Tensor
    waves: torch.Tensor
    phases: torch.Tensor
    amplitudes: torch.Tensor
    middle: torch.Tensor
    half_sides: torch.Tensor
    turn: torch.Tensor


def stacked(grounds: list[Grounds]) -> Grounds:
    """Those of many as one."""
    return Grounds(**{one.name: torch.cat([getattr(g, one.name) for g in grounds]) for one in fields(Grounds)})


def draw_ground(rng: np.random.Generator) -> Grounds:
    """One ground: plain, wood, cloth or stone, of low contrast, in colours of dataset.distributions."""
    (albedo,), _ = distributions.draw_colors(rng, np.array([rng.choice([1, 2, 3], p=[0.2, 0.6, 0.2])]))
    pattern = rng.choice(["plain", "wood", "cloth", "stone"], p=[0.25, 0.3, 0.2, 0.25])
    angle = rng.uniform(0, np.pi)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    if pattern == "wood":
        waves = np.exp(rng.uniform(np.log(1.5), np.log(25.0), (WAVES, 1))) * across
        waves = waves + rng.normal(0.0, 0.5, (WAVES, 1)) * along
    elif pattern == "cloth":
        pitch = np.exp(rng.uniform(np.log(2.0), np.log(30.0)))
        which = np.arange(WAVES)[:, None] % 2
        waves = pitch * rng.integers(1, 4, (WAVES, 1)) * np.where(which, along, across)
    else:
        waves = rng.normal(size=(WAVES, 2))
        waves *= np.exp(rng.uniform(np.log(0.4), np.log(12.0), (WAVES, 1))) / np.linalg.norm(waves, axis=1)[:, None]
    contrast = 0.02 if pattern == "plain" else np.exp(rng.normal(np.log(0.15), 0.5))
    shares = np.sqrt(2 * rng.dirichlet(np.ones(WAVES)))[:, None] * contrast
    amplitudes = shares * (1 + np.outer(rng.normal(0.0, 1.0, WAVES), [0.0, 0.2, 0.4]))
    half = np.exp(rng.uniform(np.log(HALF_SIDES[0]), np.log(HALF_SIDES[1]), 2))
    middle = rng.uniform(-1, 1, 2) * np.maximum(half - LEAST_TO_EDGE, 0.0)
    if rng.random() < ENDLESS:
        half, middle = np.full(2, 1e6), np.zeros(2)
    values = {
        "albedo": albedo,
        "waves": waves,
        "phases": rng.uniform(0, 2 * np.pi, WAVES),
        "amplitudes": amplitudes,
        "middle": middle,
        "half_sides": half,
        "turn": rng.uniform(0, np.pi),
    }
    return Grounds(**{name: torch.from_numpy(np.asarray(value, np.float32))[None] for name, value in values.items()})


def albedo_at(grounds: Grounds, q: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Albedo [B, N, 3] at points q [B, N, 2], and whether these are on the table, [B, N]."""
    across = FOOTPRINT * (1 + (q * q).sum(dim=-1, keepdim=True))  # what a pixel takes in there
    speed = torch.linalg.norm(grounds.waves, dim=-1)[:, None]
    fade = torch.exp(-0.5 * (speed * across).clip(max=6.0) ** 2)
    pattern = torch.sin(q @ grounds.waves.mT + grounds.phases[:, None]) * fade  # [B, N, W]
    ln = pattern @ grounds.amplitudes
    albedo = (grounds.albedo[:, None] * torch.exp(ln)).clip(max=distributions.MOST_ALBEDO)
    cosine, sine = torch.cos(grounds.turn)[:, None], torch.sin(grounds.turn)[:, None]
    along = cosine * q[..., 0] + sine * q[..., 1] - grounds.middle[:, None, 0]
    across = cosine * q[..., 1] - sine * q[..., 0] - grounds.middle[:, None, 1]
    half_along, half_across = grounds.half_sides[:, None].unbind(dim=-1)
    return albedo, (along.abs() < half_along) & (across.abs() < half_across)


def irradiance_from_above(radiance: torch.Tensor) -> torch.Tensor:
    """E [3] on level ground of the upper half of a map [H, 2H, 3]."""
    height = radiance.shape[0]
    d = torch.from_numpy(pixel_directions(height)[: height // 2, :, 1])
    weight = d * torch.from_numpy(pixel_solid_angles(height)[: height // 2])
    return (radiance[: height // 2].cpu() * weight[..., None]).sum(dim=(0, 1)).to(radiance.device)


def add_ground(radiance: torch.Tensor, ground: Grounds) -> tuple[torch.Tensor, torch.Tensor]:
    """A map [H, 2H, 3] with a ground below its horizon, [H, 2H, 3] twice: as seen from the object's centre with the
    object away, and as the object sees it, darkened as a sphere of radius^2 OWN_SHADOW in its place would darken it
    under an even sky."""
    height = radiance.shape[0]
    d = torch.from_numpy(pixel_directions(height)[height // 2 :].reshape(1, -1, 3))
    q = d[..., [0, 2]] / -d[..., 1:2].clip(max=-1e-4)
    albedo, on = albedo_at(ground, q)
    lit = albedo[0] * irradiance_from_above(radiance) / np.pi
    hidden = OWN_SHADOW / (1 + (q[0] ** 2).sum(dim=-1, keepdim=True)) ** 1.5
    floor = radiance[height // 2 :].reshape(-1, 3)
    parts = []
    for seen in (lit, lit * (1 - hidden)):
        below = torch.where(on[0][:, None], seen, floor).reshape(height // 2, 2 * height, 3)
        parts.append(torch.cat([radiance[: height // 2], below]))
    return parts[0], parts[1]


def light_directions(radiance: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Directions [K, 3] in which the upper half of a map [H, 2H, 3] lights level ground, drawn by how much each does,
    and the irradiance [K, 3] that each brings; together exactly that of irradiance_from_above.
    """
    height = radiance.shape[0]
    upper = radiance[: height // 2].astype(np.float64)
    cosine = pixel_directions(height)[: height // 2, :, 1:2] * pixel_solid_angles(height)[: height // 2, None]
    brought = (upper * cosine).reshape(-1, 3)
    upto = np.cumsum(luminance(brought) + 1e-12)
    places = (np.arange(count) + rng.random(count)) / count * upto[-1]
    index = np.minimum(np.searchsorted(upto, places, side="right"), len(upto) - 1)
    row, column = np.divmod(index, 2 * height)
    uv = np.stack([(column + rng.random(count)) / (2 * height), (row + rng.random(count)) / height], axis=-1)
    hue = brought[index] / (luminance(brought[index]) + 1e-12)[:, None]
    total = brought.sum(axis=0)
    weights = hue * total / np.maximum(hue.sum(axis=0), 1e-9)
    return uv_to_direction(uv).astype(np.float32), weights.astype(np.float32)


@dataclass(frozen=True, kw_only=True, slots=True)
class Stand:
    """What a lit material stands on: its ground (one of Grounds); map_from_camera [3, 3]; the map without the ground
    [64, 128, 3] in the camera's frame; directions [K, 3] of light in the map's frame and the irradiance [K, 3] of each.
    """

    ground: Grounds
    map_from_camera: np.ndarray
    base: torch.Tensor
    directions: np.ndarray
    weights: np.ndarray


def make_stand(
    radiance: torch.Tensor, ground: Grounds, map_from_camera: np.ndarray, base: torch.Tensor, rng: np.random.Generator
) -> Stand:
    """radiance: the map [H, 2H, 3] without the ground."""
    directions, weights = light_directions(
        shrink(radiance.cpu().numpy(), min(SAMPLED_ROWS, len(radiance))), DIRECTIONS, rng
    )
    return Stand(ground=ground, map_from_camera=map_from_camera, base=base, directions=directions, weights=weights)


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenes:
    """B objects on their grounds, in the cameras' frames and in heights of the objects' centres.

    center [B, 3]: of the object, from the eye; map_from_camera [B, 3, 3]; irradiance [B, 3, GROUND_GRID, GROUND_GRID]
    of the ground around the object, row along +Z and column along +X of the map, and its half side reach [B];
    open_irradiance [B, 3]: of all other ground; base [B, 3, H, 2H]: what is behind, camera frame.
    """

    center: torch.Tensor
    map_from_camera: torch.Tensor
    irradiance: torch.Tensor
    reach: torch.Tensor
    open_irradiance: torch.Tensor
    grounds: Grounds
    base: torch.Tensor

    def up(self) -> torch.Tensor:
        """[B, 3], unit, camera frame."""
        return self.map_from_camera[:, 1]

    def see(self, rays: torch.Tensor) -> torch.Tensor:
        """Radiance [B, 3, H, W] along unit rays [B, H, W, 3] from the eye, as if the object were not in their way."""
        count, rows, columns = rays.shape[:3]
        flat = rays.flatten(1, 2)
        behind = F.grid_sample(
            self.base, direction_to_uv(rays) * 2 - 1, mode="bilinear", padding_mode="border", align_corners=False
        )
        d = flat @ self.map_from_camera.mT  # [B, N, 3], map frame
        center = (self.map_from_camera @ self.center[..., None])[..., 0]
        eye = 1.0 - center[:, 1]  # its height
        length = eye[:, None] / -d[..., 1].clip(max=-1e-4)
        q = length[..., None] * d[..., [0, 2]] - center[:, None, [0, 2]]
        albedo, on = albedo_at(self.grounds, q.clip(-1e4, 1e4))
        places = q / self.reach[:, None, None]
        near = F.grid_sample(
            self.irradiance, places[:, None], mode="bilinear", padding_mode="border", align_corners=False
        )[:, :, 0].mT  # [B, N, 3]
        inside = (places.abs() < 1).all(dim=-1, keepdim=True)
        lit = torch.where(inside, near, self.open_irradiance[:, None])
        ground = (albedo * lit / np.pi).mT.unflatten(2, (rows, columns))
        on = (on & (d[..., 1] < -1e-3) & (eye[:, None] > 0)).unflatten(1, (rows, columns))[:, None]
        return torch.where(on, ground, behind)


def make_scenes(stands: list[Stand], points: torch.Tensor, center: torch.Tensor) -> Scenes:
    """Objects of points [B, P, 3] from their centres, and centres [B, 3] from the eye, in any one unit, camera frame:
    each stands on its ground on its lowest point."""
    device = points.device
    turns = torch.from_numpy(np.stack([one.map_from_camera for one in stands]).astype(np.float32)).to(device)
    placed = points @ turns.mT  # map frame
    height = -placed[..., 1].amin(dim=1).clip(max=-1e-3)
    placed, center = placed / height[:, None, None], center / height[:, None]
    outline = torch.linalg.norm(placed[..., [0, 2]], dim=-1).amax(dim=1)
    reach = REACH * outline.clip(min=1.0)
    d = torch.from_numpy(np.stack([one.directions for one in stands])).to(device)
    weights = torch.from_numpy(np.stack([one.weights for one in stands])).to(device)
    shown = 1.0 - cast(placed, d, reach).float()  # [B, K, G, G]
    irradiance = torch.einsum("bkc,bkn->bcn", weights, shown.flatten(2)).unflatten(2, (GROUND_GRID, GROUND_GRID))
    return Scenes(
        center=center,
        map_from_camera=turns,
        irradiance=irradiance,
        reach=reach,
        open_irradiance=weights.sum(dim=1),
        grounds=stacked([one.ground for one in stands]),
        base=torch.stack([one.base for one in stands]).permute(0, 3, 1, 2),
    )


def cast(points: torch.Tensor, directions: torch.Tensor, reach: torch.Tensor) -> torch.Tensor:
    """Shadows [B, K, GROUND_GRID, GROUND_GRID] uint8, 1 where an object stands between ground and a direction.

    points: [B, P, 3] from the object's centre, whose height is 1, map frame; directions: [B, K, 3] towards the light;
    reach [B]: half of the picture's side. Single cells that no point falls in are filled.
    """
    count, number = directions.shape[:2]
    slope = directions[..., [0, 2]] / directions[..., 1:2].clip(min=LEAST_SINE)  # [B, K, 2]
    above = (points[..., 1] + 1.0).clip(min=0.0)  # height over the ground
    scale = (0.5 * GROUND_GRID / reach)[:, None, None]
    x, z = (
        points[:, None, :, axis] - slope[:, :, None, part] * above[:, None] for part, axis in ((0, 0), (1, 2))
    )  # [B, K, P]
    column = (x * scale + 0.5 * GROUND_GRID).floor_().clip_(-1, GROUND_GRID).int()
    row = (z * scale + 0.5 * GROUND_GRID).floor_().clip_(-1, GROUND_GRID).int()
    side = GROUND_GRID + 2
    first = torch.arange(count * number, device=points.device, dtype=torch.int32).reshape(count, number, 1)
    index = (first * side + row + 1) * side + column + 1
    grid = torch.zeros(count * number * side * side, dtype=torch.uint8, device=points.device)
    grid[index.flatten().long()] = 1
    grid = grid.reshape(count, number, side, side)
    # closed: grown by one cell and shrunk again
    grid = grid[:, :, 1:] | grid[:, :, :-1]
    grid = grid[..., 1:] | grid[..., :-1]
    grid = grid[:, :, 1:] & grid[:, :, :-1]
    return grid[..., 1:] & grid[..., :-1]
