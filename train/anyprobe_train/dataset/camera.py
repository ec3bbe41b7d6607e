"""How a photo is taken: metering, white balance, lens blur, response curve, noise, JPEG. One Shot per photo."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device, to_device
from PIL import Image

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import CameraCurve, response
from anyprobe.errors import InputError
from anyprobe_train.dataset import distributions

SUBSAMPLINGS = ("4:4:4", "4:2:2", "4:2:0")
SHARP_SHARE = 0.5
JPEG_SHARE = 1 / 3
"""Share of photos that show their JPEG compression; the rest are PNG or, more often, were shrunk enough to hide it."""
OBJECT_RANGE = (0.03, 0.9)
"""Range of the object's mean radiance that a camera's exposure keeps to."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """Random camera settings of one photo.

    metering: how far the exposure follows the object (1) or the whole scene (0).
    object_key, scene_key: mean radiance that each of the two is exposed to.
    white_balance [3]: gain of each channel. noise: standard deviation of display values.
    blur_px: standard deviation of the lens blur in pixels of the crop, 0 for none.
    jpeg_quality: on libjpeg's scale, None for no JPEG; jpeg_subsampling: one of SUBSAMPLINGS.
    object_range: bounds of the object's mean radiance, whatever the camera meters.
    meters_frame: whether the camera meters as phones do: it brings the mean of the object, weighted by metering, and of
        the rest of the frame to scene_key (dataset.distributions.metered_gain) and ignores object_key.
    """

    metering: float
    object_key: float
    scene_key: float
    white_balance: np.ndarray
    curve: CameraCurve
    noise: float = 0.0
    blur_px: float = 0.0
    jpeg_quality: int | None = None
    jpeg_subsampling: str = SUBSAMPLINGS[0]
    object_range: tuple[float, float] = OBJECT_RANGE
    meters_frame: bool = False


def draw_curve(rng: np.random.Generator) -> CameraCurve:
    """Draw a camera curve as hdrcnn does (Eilertsen et al. 2017)."""
    return CameraCurve(
        exponent=float(np.clip(rng.normal(0.9, 0.1), 0.4, 1.6)), sigma=float(np.clip(rng.normal(0.6, 0.1), 0.2, 1.2))
    )


def draw_shot(rng: np.random.Generator, conditions: int = 1) -> Shot:
    """Draw the settings of a photo; its exposure varies by about two stops each way.

    conditions: 0 for the paper's clean shot, without noise, blur and JPEG; 1 as the world gives them. From one rng both
        agree in all else.
    """
    if conditions not in (0, 1):
        raise InputError(f"expected 0 (clean) or 1 (as phones take them), got {conditions!r}", subject="conditions")
    shot = Shot(
        metering=float(rng.uniform(0.0, 0.7)),
        object_key=float(np.exp(rng.uniform(np.log(0.1), np.log(0.6)))),
        scene_key=float(0.25 * np.exp(rng.uniform(np.log(0.5), np.log(2.0)))),
        white_balance=np.exp(rng.normal(0.0, 0.08, size=3)).astype(np.float32),
        curve=draw_curve(rng),
    )
    noise = float(rng.uniform(0.0, 0.012))
    sharp, blur_px = rng.random() < SHARP_SHARE, float(rng.uniform(0.3, 1.5))
    jpeg, quality = rng.random() < JPEG_SHARE, int(rng.integers(40, 99))
    subsampling = SUBSAMPLINGS[rng.integers(len(SUBSAMPLINGS))]
    if conditions == 0:
        return shot
    return replace(
        shot,
        noise=noise,
        blur_px=0.0 if sharp else blur_px,
        jpeg_quality=quality if jpeg else None,
        jpeg_subsampling=subsampling,
    )


def phone_shot(shot: Shot, ambient: np.ndarray, rng: np.random.Generator) -> Shot:
    """Return the shot with metering and white balance of dataset.distributions, in light of mean colour ambient [3]."""
    (weight,), (key,) = distributions.draw_metering(rng, 1)
    balance = distributions.draw_white_balance(rng, ambient[None])[0]
    return replace(
        shot,
        metering=float(weight),
        scene_key=float(key),
        white_balance=balance,
        meters_frame=True,
        object_range=distributions.OBJECT_RANGE,
    )


def exposure(shot: Shot, object_mean: float, scene: float) -> float:
    """Return the gain from radiance to the photo's exposure units.

    object_mean: mean luminance of the object. scene: exp(mean ln luminance) of the map, or where the shot meters the
    frame, distributions.frame_level of it.
    """
    if shot.meters_frame:
        gain = distributions.metered_gain(object_mean, scene, shot.metering, shot.scene_key)
    else:
        by_object = shot.object_key / max(object_mean, 1e-6)
        by_scene = shot.scene_key / max(scene, 1e-6)
        gain = by_object**shot.metering * by_scene ** (1.0 - shot.metering)
    mean = max(object_mean * gain, 1e-9)
    return float(gain * np.clip(mean, *shot.object_range) / mean)


def meter(
    shots: Sequence[Shot],
    rng: np.random.Generator,
    *,
    maps: Callable[[int], np.ndarray],
    brightness: Any,
    on_object: Sequence[float],
    by_phone: Sequence[bool],
) -> tuple[list[Shot], list[float]]:
    """Return the shots of N objects as metered, and the gains from radiance to exposure units before white balance.

    Args:
        maps: from an object's number to its map [H, 2H, 3], before any exposure.
        brightness: luminance of the maps [N, H, 2H], of NumPy or torch.
        on_object: mean luminance of each object.
        by_phone: which are metered and balanced as phones do it (phone_shot).
    """
    xp = array_namespace(brightness)
    # a camera that meters the whole scene sees exp(mean ln luminance)
    scene = xp.exp(xp.mean(xp.log(xp.clip(brightness, 1e-4, None)), axis=(1, 2))).tolist()
    metered = list(shots)
    for k in np.flatnonzero(by_phone).tolist():
        radiance = maps(k)
        ambient = (radiance * pixel_solid_angles(len(radiance))[..., None]).sum(axis=(0, 1))
        metered[k] = phone_shot(shots[k], ambient, rng)
        scene[k] = float(distributions.frame_level(np.asarray(to_device(brightness[k], "cpu"))))
    return metered, [exposure(*seen) for seen in zip(metered, on_object, scene, strict=True)]


def gaussian_rows(size: int, sigma: float) -> np.ndarray:
    """Return a matrix [size, size] whose row i weighs a line's pixels around pixel i; rows sum to 1 at borders too.

    Zero from 5 sigma on: products of the tail's tiny numbers would make it 20 times slower.
    """
    x = np.arange(size, dtype=np.float32)
    distance = np.abs(x[:, None] - x) / sigma
    weights = np.where(distance < 5.0, np.exp(-0.5 * distance**2), 0.0).astype(np.float32)
    return weights / weights.sum(axis=1, keepdims=True)


def blur(planes, sigma: float):
    """Blur pictures [..., S, S] by a Gaussian of sigma > 0 pixels: G p G^T."""
    xp = array_namespace(planes)
    rows = xp.asarray(gaussian_rows(planes.shape[-1], sigma), device=device(planes))
    return rows @ planes @ rows.T


def column_of(values, like) -> Any:
    """Convert one number or three per picture to [N, C, 1, 1] float32, an array of the kind and device of another."""
    values = np.asarray(values, np.float32).reshape(len(values), -1, 1, 1)
    return array_namespace(like).asarray(values, device=device(like))


def compress(picture: np.ndarray, quality: int, subsampling: str) -> np.ndarray:
    """Compress a picture [S, S, 3] uint8 as JPEG and decode it."""
    with io.BytesIO() as stream:
        Image.fromarray(picture).save(stream, "JPEG", quality=quality, subsampling=subsampling)
        with Image.open(stream) as stored:
            return np.array(stored)


def take_photo(shots: Sequence[Shot], radiance, mask, background, grain, tone: Callable | None = None) -> Any:
    """Take photos as cameras do: white balance, lens, curve, noise, 8 bits, JPEG.

    The lens blurs light, before the curve clips it: a light source spreads as it does in a
    camera, brighter than white, and the object's rim takes from what is behind it.

    Args:
        radiance: [N, 3, S, S] of the objects in exposure units before white balance.
        mask: [N, 1, S, S] bool, where the objects are in truth.
        background: [N, 3, S, S] likewise; None for black, of which then nothing comes onto
            the object: neither the blur nor JPEG knows of it.
        grain: [N, 3, S, S], normal numbers of deviation 1 for the noise.
        tone: the cameras' response; None: that of a single photo's curve.
    Returns:
        [N, 3, S, S] float32, whole numbers from 0 to 255; arrays of the same kind.
    """
    xp = array_namespace(radiance)
    tone = tone or partial(response, curve=shots[0].curve)
    behind = xp.zeros_like(radiance) if background is None else background
    scene = xp.where(mask, radiance, behind) * column_of([shot.white_balance for shot in shots], radiance)
    cover = xp.astype(mask, scene.dtype)
    for k, shot in enumerate(shots):
        if shot.blur_px > 0.0:
            scene[k] = blur(scene[k], shot.blur_px)
            if background is None:
                scene[k] = scene[k] / xp.clip(blur(cover[k], shot.blur_px), 1e-6, None)
    display = tone(scene)
    levels = xp.round(xp.clip(display + grain * column_of([shot.noise for shot in shots], radiance), 0.0, 1.0) * 255.0)
    for k, shot in enumerate(shots):
        if shot.jpeg_quality is None:
            continue
        if background is None and mask[k].any():
            mean = xp.mean(display[k][:, mask[k, 0]], axis=1)
            levels[k] = xp.where(mask[k], levels[k], xp.round(xp.clip(mean, 0.0, 1.0) * 255.0)[:, None, None])
        picture = np.moveaxis(np.asarray(to_device(levels[k], "cpu")), 0, -1).astype(np.uint8, order="C")
        stored = compress(picture, shot.jpeg_quality, shot.jpeg_subsampling).astype(np.float32)
        levels[k] = xp.asarray(np.moveaxis(stored, -1, 0), device=device(levels))
    return levels * cover if background is None else levels


def as_planes(picture: np.ndarray) -> np.ndarray:
    """Convert a picture [S, S, 3] to [1, 3, S, S] float32, as take_photo takes it."""
    return np.ascontiguousarray(np.moveaxis(picture, -1, 0)[None], dtype=np.float32)


def one_photo(
    shot: Shot, radiance: np.ndarray, mask: np.ndarray, background: np.ndarray | None, rng: np.random.Generator
) -> np.ndarray:
    """Take one photo of [S, S, 3], mask [S, S] and background [S, S, 3] or None, grain by rng: [S, S, 3] uint8."""
    behind = None if background is None else as_planes(background)
    grain = as_planes(rng.standard_normal(radiance.shape, np.float32))
    levels = take_photo([shot], as_planes(radiance), mask[None, None], behind, grain)[0]
    return np.moveaxis(levels, 0, -1).astype(np.uint8, order="C")
