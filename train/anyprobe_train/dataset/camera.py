"""How a photo is taken: metering, white balance, lens blur, response curve, noise, JPEG. One Shot per photo."""

import io
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance
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


def meter(
    shot: Shot, light: np.ndarray, object_mean: float, by_phone: bool, rng: np.random.Generator
) -> tuple[Shot, float]:
    """Return the shot as metered, and the gain from radiance to exposure units before white balance.

    light: the map [H, 2H, 3] before any exposure. object_mean: mean luminance of the object. by_phone: whether it is
    metered and balanced as phones do it, by dataset.distributions, which ignores the shot's own metering and keys.
    """
    brightness = luminance(light)
    if by_phone:
        (weight,), (key,) = distributions.draw_metering(rng, 1)
        ambient = (light * pixel_solid_angles(len(light))[..., None]).sum(axis=(0, 1))
        shot = replace(shot, white_balance=distributions.draw_white_balance(rng, ambient[None])[0])
        frame, bounds = float(distributions.frame_level(brightness)), distributions.OBJECT_RANGE
        gain = distributions.metered_gain(object_mean, frame, weight, key)
    else:  # a camera that meters the whole scene sees exp(mean ln luminance)
        scene, bounds = float(np.exp(np.log(np.clip(brightness, 1e-4, None)).mean())), OBJECT_RANGE
        by_object, by_scene = shot.object_key / max(object_mean, 1e-6), shot.scene_key / max(scene, 1e-6)
        gain = by_object**shot.metering * by_scene ** (1.0 - shot.metering)
    mean = max(object_mean * gain, 1e-9)
    return shot, float(gain * np.clip(mean, *bounds) / mean)


def blur(planes: np.ndarray, sigma: float) -> np.ndarray:
    """Blur pictures [..., S, S] by a Gaussian of sigma > 0 pixels: G p G^T.

    Row i of G [S, S] weighs a line's pixels around pixel i; rows sum to 1 at borders too. They are zero from 5 sigma
    on: products of the tail's tiny numbers would make it 20 times slower.
    """
    x = np.arange(planes.shape[-1], dtype=np.float32)
    distance = np.abs(x[:, None] - x) / sigma
    weights = np.where(distance < 5.0, np.exp(-0.5 * distance**2), 0.0).astype(np.float32)
    rows = weights / weights.sum(axis=1, keepdims=True)
    return rows @ planes @ rows.T


def compress(picture: np.ndarray, quality: int, subsampling: str) -> np.ndarray:
    """Compress a picture [S, S, 3] uint8 as JPEG and decode it."""
    with io.BytesIO() as stream:
        Image.fromarray(picture).save(stream, "JPEG", quality=quality, subsampling=subsampling)
        with Image.open(stream) as stored:
            return np.array(stored)


def one_photo(
    shot: Shot, radiance: np.ndarray, mask: np.ndarray, background: np.ndarray | None, rng: np.random.Generator
) -> np.ndarray:
    """Take a photo as cameras do: white balance, lens, curve, noise, 8 bits, JPEG.

    The lens blurs light, before the curve clips it: a light source spreads as it does in a
    camera, brighter than white, and the object's rim takes from what is behind it.

    Args:
        radiance: [S, S, 3] of the object in exposure units before white balance.
        mask: [S, S] bool, where the object is in truth.
        background: [S, S, 3] likewise; None for black, of which then nothing comes onto
            the object: neither the blur nor JPEG knows of it.
        rng: of the noise.
    Returns:
        [S, S, 3] uint8.
    """
    grain = np.moveaxis(rng.standard_normal(radiance.shape, np.float32), -1, 0)
    behind = np.float32(0) if background is None else background
    scene = np.moveaxis(np.where(mask[..., None], radiance, behind), -1, 0).astype(np.float32, order="C")
    scene = scene * np.asarray(shot.white_balance, np.float32)[:, None, None]
    if shot.blur_px > 0.0:
        scene = blur(scene, shot.blur_px)
        if background is None:
            scene = scene / np.clip(blur(mask.astype(np.float32), shot.blur_px), 1e-6, None)
    display = response(scene, curve=shot.curve)
    levels = np.round(np.clip(display + grain * np.float32(shot.noise), 0.0, 1.0) * 255.0)
    if shot.jpeg_quality is not None and background is None and mask.any():
        mean = display[:, mask].mean(axis=1)
        levels = np.where(mask, levels, np.round(np.clip(mean, 0.0, 1.0) * 255.0)[:, None, None])
    picture = np.moveaxis(levels, 0, -1).astype(np.uint8, order="C")
    if shot.jpeg_quality is not None:
        picture = compress(picture, shot.jpeg_quality, shot.jpeg_subsampling)
    return picture * mask[..., None] if background is None else picture
