"""Maps varied (blends, lamps, a dominant light moved), and materials lit by maps.

Light is additive, so the sum of two rooms is a possible light. A lit material holds the reflectance maps of one light,
one view of it and one alpha.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import MAP_HEIGHT, integral, reduced, rotate
from anyprobe.light.light_sources import BLUR_RADIUS, dilate, find_dominant_light
from anyprobe.light.octahedral import Pyramid
from anyprobe.render.integrate import shade_diffuse, shade_specular, shading_pyramid
from anyprobe_train.dataset.reflectance import reflectance_normals
from anyprobe_train.dataset.sky import soft_cap

INDUCTOR_OPTIONS: dict[str, Any] = {
    # By default the compiler writes every long expression to memory and reads it back, and
    # checks each index. 6,200 points x 64 samples on two cores: 27 ms so, 5 ms with these.
    "realize_opcount_threshold": 100_000,
    "realize_reads_threshold": 100_000,
    "assert_indirect_indexing": False,
}


def compile_kernel(function: Callable) -> Callable:
    """Apply torch.compile to shade_specular, shade_diffuse or lookup; one kernel for each size of arguments."""
    return torch.compile(function, options=INDUCTOR_OPTIONS, dynamic=False)


SEARCH_HEIGHT = 64
"""Rows of the map in which the dominant light is found."""

MAX_RADIUS = np.radians(35.0)
"""Largest radius of a light that is moved [radians]; a wider one is the surround itself."""


def turn(radiance: np.ndarray, columns: int, mirrored: bool = False) -> np.ndarray:
    """Return the map turned about +Y by whole columns, to the right; first mirrored left to right if asked."""
    return np.roll(radiance[:, ::-1] if mirrored else radiance, columns, axis=1)


def blend_maps(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """Return (1 - share) one + share other."""
    return (1 - share) * one + share * other


def add_lamp(
    radiance: np.ndarray, direction: np.ndarray, radius: float, power: np.ndarray, softness: float = 0.3
) -> np.ndarray:
    """Add a soft round light source whose integral over the sphere is power [3]."""
    height = radiance.shape[0]
    cap = soft_cap(pixel_directions(height).astype(np.float64), direction, radius, softness)
    total = (cap[..., 0] * pixel_solid_angles(height)).sum()
    if total <= 0:
        raise ValueError(
            f"expected a light source wider than a pixel, got a radius of {np.degrees(radius):.2g} degrees"
        )
    return radiance + cap * (np.asarray(power) / total)


def split_light_cap(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the map without its dominant light, that light alone, and its direction [3]; their sum is the map.

    The light is what a cap around the lobe of find_dominant_light has more than the mean of a ring around
    the cap. None where no light stands out, or one wider than MAX_RADIUS does.
    """
    height = radiance.shape[0]
    found = find_dominant_light(reduced(radiance, SEARCH_HEIGHT))
    if not found.irradiance.any():
        return None
    radius = 1.3 * np.hypot(np.radians(found.radius_deg), BLUR_RADIUS) + np.radians(3.0)
    if radius > MAX_RADIUS:
        return None
    angle = np.arccos(np.clip(pixel_directions(height) @ found.direction, -1.0, 1.0))
    cap = angle < radius
    ring = (angle >= radius) & (angle < radius + np.radians(6.0)) | dilate(cap) & ~cap
    weights = np.broadcast_to(pixel_solid_angles(height), angle.shape)
    surround = np.average(radiance[ring], axis=0, weights=weights[ring])
    brighter = luminance(radiance) > luminance(surround)
    light = np.where((cap & brighter)[..., None], np.maximum(radiance - surround, 0.0), 0.0)
    return radiance - light, light, found.direction.astype(np.float64)


def move_dominant_light(radiance: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Move the dominant light of a map to direction [3]; its power stays, and it stays upright."""
    split = split_light_cap(radiance)
    if split is None:
        return radiance
    rest, light, old = split
    moved = rotate(light, _upright_turn(old, direction)).astype(np.float64)
    before, after = integral(light.astype(np.float64)), integral(moved)
    if (after <= 0.1 * before).any():  # fell between the pixels
        return radiance
    return rest + moved * (before / np.where(after > 0, after, 1.0))


def _upright_turn(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return a rotation [3, 3] that carries old to new and tilts about a level axis between two turns about +Y."""

    def angles(d):
        return np.arctan2(d[0], -d[2]), np.arcsin(np.clip(d[1], -1.0, 1.0))

    (a, e), (b, f) = angles(old), angles(new)
    return rotation_y(-b) @ rotation_x(f - e) @ rotation_y(a)


SIZE = 128
"""Side of the stored reflectance maps."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LitMaterial:
    """Reflectance maps of a material under one light.

    terms [12, SIZE, SIZE]: Eq. 5's irradiance, S1, Ss, Dd, three channels each;
    radiance [64, 128, 3]: the map in the camera's frame; alpha; elevation class.
    """

    terms: torch.Tensor
    radiance: torch.Tensor
    alpha: float
    elevation: int


BUDGETS = ((0.12, 0.0, 128, 16), (0.3, 0.2, 64, 32), (np.inf, 1.0, 40, 48))
"""Budgets by alpha: its upper bound; the alpha of the pyramid; side of the computed reflectance map, and samples per
pixel. Narrow lobes need pixels, wide ones samples."""


def _look(radiance: torch.Tensor, d: torch.Tensor) -> torch.Tensor:
    """Sample a map [H, 2H, 3] along unit directions [N, 3]."""
    return bilinear(radiance, direction_to_uv(d))


class Illuminator:
    """Shader of reflectance maps from a list of maps; compiled if a compiler is available."""

    def __init__(self, maps: list[np.ndarray], device: str = "cpu", compiled: bool = True) -> None:
        self.device = device
        self.maps = [torch.from_numpy(np.ascontiguousarray(radiance)).to(device) for radiance in maps]
        self._pyramids: dict[tuple[float, int], Pyramid] = {}
        self.wrap = compile_kernel if compiled else (lambda function: function)
        self._directions = self._tensor(pixel_directions(4 * MAP_HEIGHT).reshape(-1, 3))
        kernels = (shade_specular, shade_diffuse, _look)
        self._specular, self._diffuse, self._look = (self.wrap(kernel) for kernel in kernels)

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32)).to(self.device)

    def _pyramid(self, width: float, number: int) -> Pyramid:
        """Return the pyramid of a map by its number, built at its first use."""
        key = width, number
        if key not in self._pyramids:
            self._pyramids[key] = shading_pyramid(self.maps[number], width).to(self.device)
        return self._pyramids[key]

    @torch.no_grad()
    def light(self, number: int, rotation: np.ndarray, alpha: float, elevation: int) -> LitMaterial:
        """Light one material by a map, seen through rotation [3, 3] = world from camera (mirrored or not)."""
        _, width, size, samples = next(budget for budget in BUDGETS if alpha < budget[0])
        world = self._tensor(rotation.T)
        n = self._tensor(reflectance_normals(size).reshape(-1, 3)) @ world
        wo = self._tensor(np.tile([0.0, 0.0, 1.0], (len(n), 1))) @ world
        u = self._tensor(hammersley(samples))
        alphas = torch.full((len(n), 1), alpha, device=self.device)
        specular = torch.cat(self._specular(self._pyramid(width, number), n, wo, alphas, u), dim=1)
        coarse = self._tensor(reflectance_normals(32).reshape(-1, 3)) @ world
        diffuse_pyramid = self._pyramid(1.0, number)
        diffuse = self._diffuse(diffuse_pyramid, coarse, wo[: len(coarse)].contiguous(), self._tensor(hammersley(64)))
        terms = [_picture(specular, size), _picture(diffuse, 32)]
        sampled = self._look(self.maps[number], self._directions @ world)
        radiance = sampled.reshape(MAP_HEIGHT, 4, 2 * MAP_HEIGHT, 4, 3).mean(dim=(1, 3))
        return LitMaterial(terms=torch.cat(terms), radiance=radiance, alpha=alpha, elevation=elevation)


def _picture(values: torch.Tensor, size: int) -> torch.Tensor:
    """Convert [size * size, C] to [C, SIZE, SIZE]."""
    picture = values.reshape(1, size, size, -1).permute(0, 3, 1, 2)
    if size != SIZE:
        picture = torch.nn.functional.interpolate(picture, size=(SIZE, SIZE), mode="bilinear", align_corners=False)
    return picture[0].contiguous()
