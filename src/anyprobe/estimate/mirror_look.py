"""A second look at an object's crop, in a mirror: whichever way a photo is given, the same of two lights is taken."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.estimate.photo import Crop
from anyprobe.estimate.runtime import Outputs

if TYPE_CHECKING:
    from jaxtyping import Float

MIRRORED = np.array([-1.0, 1.0, 1.0], np.float32)
"""Factors of a vector's components [3] in the mirror."""


def mirrored_crop(crop: Crop) -> Crop:
    """Return the crop as a mirror shows it, in the mirrored crop's frame."""
    return replace(
        crop,
        image=crop.image[:, ::-1],
        normals=None if crop.normals is None else crop.normals[:, ::-1] * MIRRORED,
        surroundings_map=None if crop.surroundings_map is None else crop.surroundings_map[:, ::-1],
        context=None if crop.context is None else crop.context[:, ::-1],
    )


def mirrored_back(outputs: Outputs) -> Outputs:
    """Return the answer to a mirrored crop in the frame of the crop itself."""
    return replace(
        outputs,
        radiance=outputs.radiance[:, ::-1],
        irradiance=outputs.irradiance[:, ::-1],
        ldr=outputs.ldr[:, ::-1],
        ln_radiance=outputs.ln_radiance[:, ::-1],
        confidence=None if outputs.confidence is None else outputs.confidence[:, ::-1],
        normals=None if outputs.normals is None else outputs.normals[:, ::-1] * MIRRORED,
        posture=None if outputs.posture is None else outputs.posture * (1.0, 1.0, -1.0),
        expected=None if outputs.expected is None else outputs.expected[:, ::-1],
    )


def likelier(one: Outputs, other: Outputs) -> Outputs:
    """Return the answer whose light comes from where both answers expect light, with the mean of their expected maps.

    Compared is the luminance of that mean, averaged over the directions that an answer's light comes from.
    """
    assert one.expected is not None  # of models that lift
    assert other.expected is not None
    expected = (one.expected + other.expected) / np.float32(2.0)
    first = _agreement(one.radiance, expected) >= _agreement(other.radiance, expected)
    return replace(one if first else other, expected=expected)


def _agreement(radiance: Float[np.ndarray, "H 2*H 3"], expected: Float[np.ndarray, "H 2*H 3"]) -> float:
    light = luminance(radiance).astype(np.float64) * pixel_solid_angles(len(radiance))
    return float((light * luminance(expected)).sum() / max(light.sum(), 1e-9))
