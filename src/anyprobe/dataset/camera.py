"""How a photo is taken: metering, white balance, response curve, noise. One Shot per photo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.response import CameraCurve


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """The draws of one photo.

    metering: how far the exposure follows the object (1) or the whole scene (0).
    object_key, scene_key: mean radiance that each of the two would be given.
    white_balance [3]: gain a channel. noise: standard deviation of display values.
    """

    metering: float
    object_key: float
    scene_key: float
    white_balance: np.ndarray
    curve: CameraCurve
    noise: float


OBJECT_RANGE = (0.03, 0.9)
"""No camera leaves its subject darker or brighter than this mean radiance."""


def draw_shot(rng: np.random.Generator) -> Shot:
    """Curve and noise as in hdrcnn (Eilertsen et al. 2017); the exposure spans about two stops each way."""
    return Shot(
        metering=float(rng.uniform(0.0, 0.7)),
        object_key=float(np.exp(rng.uniform(np.log(0.1), np.log(0.6)))),
        scene_key=float(0.25 * np.exp(rng.uniform(np.log(0.5), np.log(2.0)))),
        white_balance=np.exp(rng.normal(0.0, 0.08, size=3)).astype(np.float32),
        curve=CameraCurve(
            exponent=float(np.clip(rng.normal(0.9, 0.1), 0.4, 1.6)),
            sigma=float(np.clip(rng.normal(0.6, 0.1), 0.2, 1.2)),
        ),
        noise=float(rng.uniform(0.0, 0.012)),
    )


def exposure(shot: Shot, object_mean: float, scene_log_mean: float) -> float:
    """The gain from radiance to the photo's exposure units.

    object_mean: mean luminance of the object. scene_log_mean: exp(mean ln luminance) of the map.
    """
    by_object = shot.object_key / max(object_mean, 1e-6)
    by_scene = shot.scene_key / max(scene_log_mean, 1e-6)
    gain = by_object**shot.metering * by_scene ** (1.0 - shot.metering)
    mean = max(object_mean * gain, 1e-9)
    return float(gain * np.clip(mean, *OBJECT_RANGE) / mean)
