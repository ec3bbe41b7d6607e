"""Photos of lit objects: metering, mask errors and camera, the same for exact pairs and those made on the fly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.learning.dataset import distributions
from anyprobe.learning.dataset.camera import Shot, exposure, phone_shot, take_photo
from anyprobe.learning.dataset.mask_errors import disturb_mask


@dataclass(frozen=True, kw_only=True, slots=True)
class LitObjects:
    """N objects under their light, before any exposure; arrays of NumPy or torch.

    radiance [N, 3, S, S], anything beside the objects; mask [N, 1, S, S] bool.
    on_object [N]: mean luminance of each.
    brightness [N, H, 2H]: luminance of their maps, and maps, each [H, 2H, 3] in NumPy.
    by_phone: which are metered and balanced as phones do it (dataset.distributions).
    """

    radiance: Any
    mask: Any
    on_object: Sequence[float]
    brightness: Any
    maps: Callable[[int], np.ndarray]
    by_phone: Sequence[bool]


@dataclass(frozen=True, kw_only=True, slots=True)
class Photographed:
    """Photos of N objects.

    photo [N, 3, S, S]: whole numbers from 0 to 255, zero beside the mask; mask [N, S, S] bool, NumPy, as found;
    gain [N]: from radiance to the photos' units before white balance.
    """

    shots: list[Shot]
    photo: Any
    mask: np.ndarray
    gain: list[float]


def photograph(
    shots: Sequence[Shot],
    lit: LitObjects,
    rng: np.random.Generator,
    *,
    behind: Callable[[list[float]], Any],
    grain: Callable[[], Any],
    flawed: bool,
    tone: Callable | None = None,
) -> Photographed:
    """Meter, see the background, disturb the masks and take the photos.

    Args:
        behind: from the gains to what the photos show beside the objects, [N, 3, S, S] in their units, or None.
        grain: normal numbers [N, 3, S, S], asked for last.
        flawed: whether masks are as users give them (mask_errors), else exact.
        tone: see camera.take_photo.
    """
    xp = array_namespace(lit.radiance)
    shots = [phone_shot(shot, _ambient(lit.maps(k)), rng) if lit.by_phone[k] else shot for k, shot in enumerate(shots)]
    gain = _meter(shots, lit)
    factor = xp.asarray(gain, dtype=lit.radiance.dtype, device=device(lit.radiance))
    exposed = xp.astype(lit.radiance * factor[:, None, None, None], xp.float32)
    background = behind(gain)
    masks = np.asarray(lit.mask[:, 0].cpu() if hasattr(lit.mask, "cpu") else lit.mask[:, 0])
    if flawed:
        masks = np.stack([disturb_mask(mask, rng) for mask in masks])
    photo = take_photo(shots, exposed, lit.mask, background, grain(), tone)
    cover = xp.asarray(masks[:, None], dtype=photo.dtype, device=device(photo))
    return Photographed(shots=shots, photo=photo * cover, mask=masks, gain=gain)


def _ambient(radiance: np.ndarray) -> np.ndarray:
    """Return the integral of a map [H, 2H, 3] over the sphere, [3]."""
    return (radiance * pixel_solid_angles(radiance.shape[0])[..., None]).sum(axis=(0, 1))


def _meter(shots: list[Shot], lit: LitObjects) -> list[float]:
    """Return the gain from radiance to each photo's exposure units."""
    xp = array_namespace(lit.brightness)
    # a camera that meters the whole scene sees exp(mean ln luminance)
    scene = xp.exp(xp.mean(xp.log(xp.clip(lit.brightness, 1e-4, None)), axis=(1, 2))).tolist()
    for k, shot in enumerate(shots):
        if shot.meters_frame:
            bright = lit.brightness[k]
            scene[k] = float(distributions.frame_level(bright.cpu().numpy() if hasattr(bright, "cpu") else bright))
    return [exposure(*arguments) for arguments in zip(shots, lit.on_object, scene, strict=True)]
