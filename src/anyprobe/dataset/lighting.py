"""Lit materials: reflectance maps of one light, one view of it and one alpha.

The dear part of a training pair is here, and each one serves many pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch

from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import uv_to_direction
from anyprobe.core.sampling import hammersley
from anyprobe.dataset.material import draw_alpha
from anyprobe.dataset.surfaces import NUM_ELEVATIONS, draw_elevation
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.octahedral import Pyramid, build_pyramid, lookup
from anyprobe.render.compiled import compile_kernel
from anyprobe.render.integrate import shade_diffuse, shade_specular
from anyprobe.render.reflectance import reflectance_normals

SIZE = 128
"""Side of the stored reflectance maps."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LitMaterial:
    """terms [12, SIZE, SIZE]: Eq. 5's irradiance, S1, Ss, Dd, three channels each;
    radiance [64, 128, 3]: the map in the camera's frame; alpha; elevation class."""

    terms: torch.Tensor
    radiance: torch.Tensor
    alpha: float
    elevation: int


def _budget(alpha: float) -> tuple[int, int]:
    """Side of the computed reflectance map and samples a pixel: narrow lobes need pixels, wide ones samples."""
    if alpha < 0.12:
        return 128, 16
    if alpha < 0.3:
        return 64, 48
    return 40, 96


@lru_cache(maxsize=4)
def _map_directions(height: int, supersample: int) -> torch.Tensor:
    n = height * supersample
    u, v = np.meshgrid((np.arange(2 * n) + 0.5) / (2 * n), (np.arange(n) + 0.5) / n)
    return torch.from_numpy(uv_to_direction(np.stack([u, v], -1)).astype(np.float32).reshape(-1, 3))


class Illuminator:
    """Shades reflectance maps from a stock of maps; compiled where a compiler is at hand."""

    def __init__(self, maps: list[np.ndarray], device: str = "cpu", compiled: bool = True) -> None:
        self.device = device
        self.pyramids = [build_pyramid(torch.from_numpy(radiance)) for radiance in maps]
        self.pyramids = [
            Pyramid(texels=p.texels.to(device), side=p.side, num_levels=p.num_levels) for p in self.pyramids
        ]
        wrap = compile_kernel if compiled else (lambda function: function)
        self._specular, self._diffuse, self._lookup = wrap(shade_specular), wrap(shade_diffuse), wrap(lookup)

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32)).to(self.device)

    @torch.no_grad()
    def light(self, pyramid: Pyramid, rotation: np.ndarray, alpha: float, elevation: int) -> LitMaterial:
        """One lit material seen through rotation [3, 3] = world from camera (a mirror is allowed)."""
        size, samples = _budget(alpha)
        world = self._tensor(rotation.T)
        n = self._tensor(reflectance_normals(size).reshape(-1, 3)) @ world
        wo = self._tensor(np.tile([0.0, 0.0, 1.0], (len(n), 1))) @ world
        u = self._tensor(hammersley(samples))
        width = torch.full((len(n), 1), alpha, device=self.device)
        specular = torch.cat(self._specular(pyramid, n, wo, width, u), dim=1)
        coarse = self._tensor(reflectance_normals(32).reshape(-1, 3)) @ world
        diffuse = self._diffuse(pyramid, coarse, wo[: len(coarse)].contiguous(), self._tensor(hammersley(64)))
        terms = [_picture(specular, size), _picture(diffuse, 32)]
        directions = _map_directions(MAP_HEIGHT, 4).to(self.device) @ world
        fine = self._lookup(pyramid, directions, torch.zeros(len(directions), device=self.device))
        radiance = fine.reshape(MAP_HEIGHT, 4, 2 * MAP_HEIGHT, 4, 3).mean(dim=(1, 3))
        return LitMaterial(terms=torch.cat(terms), radiance=radiance, alpha=alpha, elevation=elevation)

    def draw(self, rng: np.random.Generator) -> LitMaterial:
        """A random map, view and alpha; half of the maps mirrored."""
        pyramid = self.pyramids[rng.integers(len(self.pyramids))]
        elevation = int(rng.integers(NUM_ELEVATIONS))
        rotation = world_from_camera(
            rng.uniform(0, 2 * np.pi), draw_elevation(rng, elevation), rng.normal(0, 0.05)
        )
        if rng.random() < 0.5:
            rotation = np.diag([-1.0, 1.0, 1.0]) @ rotation
        return self.light(pyramid, rotation, draw_alpha(rng), elevation)


def _picture(values: torch.Tensor, size: int) -> torch.Tensor:
    """[size * size, C] to [C, SIZE, SIZE]."""
    picture = values.reshape(1, size, size, -1).permute(0, 3, 1, 2)
    if size != SIZE:
        picture = torch.nn.functional.interpolate(
            picture, size=(SIZE, SIZE), mode="bilinear", align_corners=False
        )
    return picture[0].contiguous()
