"""Pictures of lit materials on surfaces, a whole batch at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.response import CameraCurve, response
from anyprobe.render.surface import pixel_rays
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.camera import Shot, column_of, take_photo
from anyprobe_train.dataset.lighting import LitMaterial
from anyprobe_train.dataset.reflectance import albedo_table, lookup_coords


def shade_batch(
    chosen: list[LitMaterial],
    materials: list[Material],
    normals: torch.Tensor,
    wo: torch.Tensor,
    places: Callable = lookup_coords,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Look up lit materials by the normals [B, 3, S, S] of surfaces seen along wo [B, S, S, 3]: radiance and Eq. 5's
    first factor, [B, 3, S, S] each, anything outside the objects.

    materials: their f0 and albedo are [3], or [S, S, 3] where they differ from pixel to pixel.
    places: lookup_coords, or the same compiled.
    """
    alpha = column_of([lit.alpha for lit in chosen], normals)
    table = torch.from_numpy(albedo_table()).to(normals.device)
    *xy, gain_one, gain_grazing = places(normals.permute(0, 2, 3, 1), wo, alpha, table)
    f0, albedo = (_colors([getattr(m, name) for m in materials], normals) for name in ("f0", "albedo"))
    terms = torch.stack([lit.terms for lit in chosen])
    parts = zip(terms.split([3, 6, 3], dim=1), xy, strict=True)
    first_factor, specular, diffuse = (F.grid_sample(*part, align_corners=False) for part in parts)
    one, grazing = specular.split(3, dim=1)
    # Lo = f0 S1 + (1 - f0) (Ss + albedo Dd)
    one, grazing, diffuse = one * gain_one[:, None], grazing * gain_grazing[:, None], albedo * diffuse
    return torch.lerp(grazing + diffuse, one, f0), first_factor


def _colors(values: list[np.ndarray], like: torch.Tensor) -> torch.Tensor:
    """Stack colours [3] to [B, 3, 1, 1], or to [B, 3, S, S] if one of them is [S, S, 3]; on the device of `like`."""
    shape = np.broadcast_shapes(*(np.shape(value) for value in values))
    if len(shape) == 1:
        return column_of(values, like)
    planes = np.stack([np.moveaxis(np.broadcast_to(value, shape), -1, 0) for value in values])
    return torch.from_numpy(planes.astype(np.float32, copy=False)).to(like.device)


def pixel_wo(tan_half: torch.Tensor, size: int) -> torch.Tensor:
    """Return the pixels' directions to the camera, wo [B, S, S, 3], for tan_half [B, 1, 1, 1]; see pixel_rays."""
    unit = torch.from_numpy(pixel_rays(1.0, size)).permute(2, 0, 1).to(tan_half.device)
    slope = unit[:2] / unit[2:]
    length = torch.sqrt(1.0 + tan_half**2 * (slope**2).sum(dim=0))
    return torch.cat([slope * tan_half / length, 1.0 / length], dim=1).permute(0, 2, 3, 1)


def curves(cameras: list[CameraCurve], like: torch.Tensor) -> CameraCurve:
    """Return the camera curves of a batch as one, each number [B, 1, 1, 1] on the device of `like`."""
    return CameraCurve(
        exponent=column_of([camera.exponent for camera in cameras], like),
        sigma=column_of([camera.sigma for camera in cameras], like),
    )


def draw_grain(rng: np.random.Generator, shape: Sequence[int], device: torch.device | str) -> torch.Tensor:
    """Draw standard normal numbers on a device, seeded by one number of rng."""
    generator = torch.Generator(device=device).manual_seed(int(rng.integers(2**62)))
    return torch.randn(tuple(shape), generator=generator, device=device)


def take_photos(
    shots: list[Shot], radiance: torch.Tensor, mask: torch.Tensor, background: torch.Tensor, rng: np.random.Generator
) -> torch.Tensor:
    """Take a batch of photos with camera.take_photo, grain by rng: display values [B, 3, S, S] in steps of 1/255.

    radiance, background: [B, 3, S, S]; mask: [B, 1, S, S].
    """
    tone = partial(response, curve=curves([shot.curve for shot in shots], radiance))
    grain = draw_grain(rng, radiance.shape, radiance.device)
    return take_photo(shots, radiance, mask > 0, background, grain, tone).div_(255)
