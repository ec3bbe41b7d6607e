"""Shading of every normal by a map, exactly: Eq. 3 and 5 with the eye far away along +Z.

Light is distant and nothing casts shadows (Sect. 3.1), so radiance depends on the normal alone and is linear in the
map. The eye is the pole of both grids, of lights and of normals: turning both about it changes nothing, so a Fourier
transform around it makes a small matrix a frequency of each material.
"""

from dataclasses import dataclass

import numpy as np
import torch

from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.paper.equations import (
    diffuse_weight,
    ggx_distribution,
    outgoing_radiance,
    sample_density,
    schlick_weight,
    specular_weight,
)
from anyprobe.scatter.materials import Material


@dataclass(frozen=True, kw_only=True, slots=True)
class Rings:
    """Directions around the eye: normals in `count` rings up to 90 degrees, lights in twice as many up to 180, and four
    times as many to a ring, from +X towards +Y. Normals are numbered ring by ring; `number` itself is none of them."""

    count: int

    @property
    def around(self) -> int:
        """Directions to a ring."""
        return 4 * self.count

    @property
    def number(self) -> int:
        """Normals in all."""
        return self.count * self.around

    def angles(self, rings: int) -> np.ndarray:
        """Return the angle [radians] from the eye of the first so many rings."""
        return (np.arange(rings) + 0.5) * np.pi / (2 * self.count)

    def directions(self, rings: int) -> np.ndarray:
        """Return the directions [rings, around, 3] of the first so many rings, float32."""
        theta, phi = self.angles(rings)[:, None], (np.arange(self.around) + 0.5) * 2 * np.pi / self.around
        parts = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0.0 * phi]
        return np.stack(parts, axis=-1).astype(np.float32)

    def areas(self) -> np.ndarray:
        """Return the solid angle [sr] of a light of each ring, [2 count]."""
        edges = np.cos(np.arange(2 * self.count + 1) * np.pi / (2 * self.count))
        return (edges[:-1] - edges[1:]) * 2 * np.pi / self.around

    def normals(self) -> np.ndarray:
        """Return the normals by number [number + 1, 3]; the last, of the background, is zero."""
        return np.concatenate([self.directions(self.count).reshape(-1, 3), np.zeros((1, 3), np.float32)])

    def nearest(self, normals: np.ndarray) -> np.ndarray:
        """Return the number of the normal nearest to each of [..., 3], of any length."""
        theta = np.arctan2(np.hypot(normals[..., 0], normals[..., 1]), normals[..., 2])
        phi = np.arctan2(normals[..., 1], normals[..., 0]) / (2 * np.pi)
        ring = np.clip(theta * (2 * self.count / np.pi), 0, self.count - 1).astype(np.int64)
        return ring * self.around + (np.floor(phi * self.around).astype(np.int64) % self.around)


def lobes(material: Material, rings: Rings) -> torch.Tensor:
    """Return the spectra of Eq. 3 for red, green and blue and of Eq. 5's first factor, [F, 4, rings, 2 rings]."""
    eye = np.cos(rings.angles(rings.count))[:, None, None]  # n.wo
    theta = rings.angles(2 * rings.count)[None, :, None]
    delta = np.cos(np.arange(rings.around) * 2 * np.pi / rings.around)
    n_dot_wi = eye * np.cos(theta) + np.sqrt(1 - eye**2) * np.sin(theta) * delta
    wo_dot_h = np.sqrt(np.clip(0.5 + 0.5 * np.cos(theta), 1e-8, None))  # |wo + wi| = 2 wo.h
    above = np.maximum(n_dot_wi, 0.0)
    n_dot_h = np.clip((n_dot_wi + eye) / (2.0 * wo_dot_h), 1e-6, 1.0)
    area = rings.areas()[None, :, None]
    density = ggx_distribution(n_dot_h, material.alpha) * (n_dot_wi > 0)
    # Eq. 4's samples have density D (n.h) / (4 wo.h); those below the horizon weigh nothing
    irradiance = sample_density(density, n_dot_h, wo_dot_h) * area
    irradiance /= irradiance.sum(axis=(1, 2), keepdims=True)
    coat = specular_weight(density, eye, above, material.alpha) * area
    grazing = coat * schlick_weight(wo_dot_h)
    base = diffuse_weight(above, wo_dot_h) * area
    kernels = [outgoing_radiance(material.albedo[c], material.f0[c], coat, grazing, base) for c in range(3)]
    spectra = np.fft.rfft(np.stack([*kernels, irradiance]), axis=-1).real  # even in delta
    return torch.from_numpy(spectra.transpose(3, 0, 1, 2).astype(np.float32))


def light_places(world_from_camera: np.ndarray, rings: Rings) -> np.ndarray:
    """Return where the lights of the rings lie in a world's map for a camera, uv [2 rings, around, 2] float32."""
    directions = rings.directions(2 * rings.count) @ world_from_camera.T.astype(np.float32)
    return direction_to_uv(directions).astype(np.float32)


def light_waves(radiance: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, torch.Tensor]:
    """Return a map's light [2 rings, around, 3] at places and its spectrum [3, F, 2 rings, 2], real and imaginary."""
    light = bilinear(radiance, uv)
    waves = torch.fft.rfft(torch.from_numpy(light).permute(2, 0, 1), dim=-1)  # [3, rings, F]
    return light, torch.view_as_real(waves).permute(0, 2, 1, 3)


def shown(waves: torch.Tensor, lobe: torch.Tensor, rings: Rings) -> torch.Tensor:
    """Apply lobes to the spectra of L maps, [L, 3, F, 2 rings, 2]: photo and I-Irradiance RGB [L, 6, normals]."""
    lights = waves.permute(1, 2, 3, 0, 4).flatten(3)  # [3, F, 2 rings, L * 2]
    photo = lobe[:, :3].transpose(0, 1) @ lights
    irradiance = lobe[:, 3] @ lights
    both = torch.cat([photo, irradiance]).unflatten(3, (-1, 2)).contiguous()  # [6, F, rings, L, 2]
    values = torch.fft.irfft(torch.view_as_complex(both), n=rings.around, dim=1)  # [6, around, rings, L]
    return values.permute(3, 0, 2, 1).flatten(2)
