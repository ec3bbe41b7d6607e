"""Lit materials: reflectance maps of one light, one view of it and one alpha.

The dear part of a training pair is here, and each one serves many pairs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch

from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv, uv_to_direction
from anyprobe.core.sampling import hammersley
from anyprobe.dataset import priors
from anyprobe.dataset.material import draw_alpha
from anyprobe.dataset.surfaces import NUM_ELEVATIONS, draw_elevation
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.render.integrate import compile_kernel, shade_diffuse, shade_specular, shading_pyramid
from anyprobe.render.reflectance import reflectance_normals

SIZE = 128
"""Side of the stored reflectance maps."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LitMaterial:
    """terms [12, SIZE, SIZE]: Eq. 5's irradiance, S1, Ss, Dd, three channels each;
    radiance [64, 128, 3]: the map in the camera's frame; alpha; elevation class; kind: of priors.KINDS, None for
    the materials and cameras of the paper."""

    terms: torch.Tensor
    radiance: torch.Tensor
    alpha: float
    elevation: int
    kind: int | None = None


BUDGETS = ((0.12, 0.0, 128, 16), (0.3, 0.2, 64, 32), (np.inf, 1.0, 40, 48))
"""Below which alpha; of which alpha the pyramid is; side of the computed reflectance map and samples a pixel: narrow
lobes need pixels, wide ones samples."""


@lru_cache(maxsize=4)
def _map_directions(height: int, supersample: int) -> torch.Tensor:
    n = height * supersample
    u, v = np.meshgrid((np.arange(2 * n) + 0.5) / (2 * n), (np.arange(n) + 0.5) / n)
    return torch.from_numpy(uv_to_direction(np.stack([u, v], -1)).astype(np.float32).reshape(-1, 3))


def _look(radiance: torch.Tensor, d: torch.Tensor) -> torch.Tensor:
    """The map [H, 2H, 3] along unit directions [N, 3]."""
    return bilinear(radiance, direction_to_uv(d))


class Illuminator:
    """Shades reflectance maps from a store of maps; compiled where a compiler is at hand."""

    def __init__(self, maps: list[np.ndarray], device: str = "cpu", compiled: bool = True) -> None:
        self.device = device
        self.maps = [torch.from_numpy(np.ascontiguousarray(radiance)) for radiance in maps]
        self.pyramids = {
            width: [shading_pyramid(radiance, width).to(device) for radiance in self.maps]
            for width in {width for _, width, *_ in BUDGETS}
        }
        self.maps = [radiance.to(device) for radiance in self.maps]
        self.wrap = compile_kernel if compiled else (lambda function: function)
        kernels = (shade_specular, shade_diffuse, _look)
        self._specular, self._diffuse, self._look = (self.wrap(kernel) for kernel in kernels)

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32)).to(self.device)

    @torch.no_grad()
    def light(self, which: int, rotation: np.ndarray, alpha: float, elevation: int) -> LitMaterial:
        """One lit material under map number which, through rotation [3, 3] = world from camera (mirrored or not)."""
        _, width, size, samples = next(budget for budget in BUDGETS if alpha < budget[0])
        world = self._tensor(rotation.T)
        n = self._tensor(reflectance_normals(size).reshape(-1, 3)) @ world
        wo = self._tensor(np.tile([0.0, 0.0, 1.0], (len(n), 1))) @ world
        u = self._tensor(hammersley(samples))
        alphas = torch.full((len(n), 1), alpha, device=self.device)
        specular = torch.cat(self._specular(self.pyramids[width][which], n, wo, alphas, u), dim=1)
        coarse = self._tensor(reflectance_normals(32).reshape(-1, 3)) @ world
        wide = self.pyramids[1.0][which]
        diffuse = self._diffuse(wide, coarse, wo[: len(coarse)].contiguous(), self._tensor(hammersley(64)))
        terms = [_picture(specular, size), _picture(diffuse, 32)]
        directions = _map_directions(MAP_HEIGHT, 4).to(self.device) @ world
        fine = self._look(self.maps[which], directions)
        radiance = fine.reshape(MAP_HEIGHT, 4, 2 * MAP_HEIGHT, 4, 3).mean(dim=(1, 3))
        return LitMaterial(terms=torch.cat(terms), radiance=radiance, alpha=alpha, elevation=elevation)

    def draw(self, rng: np.random.Generator, world: float = 0.0) -> LitMaterial:
        """A random map, view and alpha; half of the maps mirrored.

        world: share of those of a kind and an alpha of dataset.priors.
        """
        which = int(rng.integers(len(self.maps)))
        elevation = int(rng.integers(NUM_ELEVATIONS))
        rotation = world_from_camera(
            rng.uniform(0, 2 * np.pi), draw_elevation(rng, elevation), rng.normal(0, 0.05)
        )
        if rng.random() < 0.5:
            rotation = np.diag([-1.0, 1.0, 1.0]) @ rotation
        alpha = draw_alpha(rng)
        if world > 0 and rng.random() < world:
            kind = priors.draw_kinds(rng, 1)
            alpha = float(priors.draw_alphas(rng, kind)[0])
            return replace(self.light(which, rotation, alpha, elevation), kind=int(kind[0]))
        return self.light(which, rotation, alpha, elevation)


def _picture(values: torch.Tensor, size: int) -> torch.Tensor:
    """[size * size, C] to [C, SIZE, SIZE]."""
    picture = values.reshape(1, size, size, -1).permute(0, 3, 1, 2)
    if size != SIZE:
        picture = torch.nn.functional.interpolate(
            picture, size=(SIZE, SIZE), mode="bilinear", align_corners=False
        )
    return picture[0].contiguous()
