"""Sprites: objects lit by one map, cut out, to be put into scenes of many objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from anyprobe.core.color import REC709
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.dataset.lighting import Illuminator
from anyprobe.dataset.material import draw_alpha, draw_material
from anyprobe.dataset.pairs import pixel_wo, shade
from anyprobe.dataset.surfaces import NUM_ELEVATIONS, SurfaceSet, draw_elevation
from anyprobe.dataset.textures import smooth_noise
from anyprobe.light.environment import MAP_HEIGHT

MATERIALS = 2
"""Lit materials of one view."""

SPRITES = 6
"""Objects of one view."""

MARKED_SHARE = 0.2
"""So many objects have spots of another colour, as painted eyes or a lid."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LitView:
    """A light seen by one camera, and objects in it.

    Attributes:
        sprites: [N, 4, S, S] radiance times cover, and cover; row N's object fills its window.
        sky: [256, 512, 3] the map in its own frame; world_from_camera: [3, 3], mirrored or not.
        elevation: of the camera [radians]; positive looks down.
        ground: [3] radiance of a white matt plane facing up.
        scene_log_mean: exp(mean ln luminance) of the map.
    """

    sprites: torch.Tensor
    sky: torch.Tensor
    world_from_camera: np.ndarray
    elevation: float
    ground: np.ndarray
    scene_log_mean: float


class ViewSource:
    """Lit views by number: view k is a function of (seed, k) alone."""

    def __init__(self, illuminator: Illuminator, surfaces: SurfaceSet, seed: int) -> None:
        self.illuminator, self.surfaces, self.seed = illuminator, surfaces, seed
        self._by_elevation = [np.nonzero(surfaces.elevation == e)[0] for e in range(NUM_ELEVATIONS)]

    @torch.no_grad()
    def view(self, number: int) -> LitView:
        """A random map, camera, two materials' lobes, and six objects of them."""
        rng = np.random.default_rng((self.seed, 1, number))
        which = int(rng.integers(len(self.illuminator.maps)))
        band = int(rng.integers(NUM_ELEVATIONS))
        elevation = draw_elevation(rng, band)
        rotation = world_from_camera(rng.uniform(0, 2 * np.pi), elevation, rng.normal(0, 0.05))
        if rng.random() < 0.5:
            rotation = np.diag([-1.0, 1.0, 1.0]) @ rotation
        lit = [self.illuminator.light(which, rotation, draw_alpha(rng), band) for _ in range(MATERIALS)]
        chosen = [lit[i % MATERIALS] for i in range(SPRITES)]
        index = rng.choice(self._by_elevation[band], SPRITES)
        normals = torch.from_numpy(self.surfaces.normals[index]).float()
        tan_half = torch.from_numpy(self.surfaces.tan_half[index]).reshape(-1, 1, 1, 1)
        materials = [draw_material(rng, one.alpha) for one in chosen]
        wo = pixel_wo(tan_half, normals.shape[-1])
        radiance, _ = shade(chosen, materials, normals, wo)
        cover = (normals.abs().sum(dim=1, keepdim=True) > 0).float()
        for one in radiance:
            if rng.random() < MARKED_SHARE:
                one.mul_(torch.from_numpy(_marks(rng, one.shape[-1])))
        return LitView(
            sprites=torch.cat([radiance * cover, cover], dim=1),
            sky=self.illuminator.maps[which],
            world_from_camera=rotation,
            elevation=elevation,
            ground=_facing(lit[0].radiance.numpy(), rotation.T @ np.array([0.0, 1.0, 0.0])),
            scene_log_mean=_log_mean(lit[0].radiance.numpy()),
        )


def _marks(rng: np.random.Generator, size: int) -> np.ndarray:
    """Factors [3, size, size]: 1, but another colour on a few spots."""
    spots = smooth_noise(rng, size, rng.uniform(1.5, 6.0)) > rng.uniform(1.0, 2.0)
    color = np.exp(rng.uniform(np.log(0.1), np.log(1.5))) * np.exp(rng.normal(0, 0.4, 3))
    return np.where(spots, color[:, None, None], 1.0).astype(np.float32)


def _facing(radiance: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Irradiance / pi [3] of a plane with normal up under a map [64, 128, 3] of the camera's frame."""
    cosine = np.maximum(pixel_directions(MAP_HEIGHT) @ up, 0.0)
    weights = cosine * pixel_solid_angles(MAP_HEIGHT)
    return (radiance * weights[..., None]).sum(axis=(0, 1)) / np.pi


def _log_mean(radiance: np.ndarray) -> float:
    return float(np.exp(np.log(np.maximum(radiance @ np.array(REC709), 1e-4)).mean()))
