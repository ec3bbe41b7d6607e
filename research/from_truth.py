"""Rows made of the true map itself, which say what a figure's scale is: one flat colour, and the truth blurred."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import inverse_response, response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.methods import Estimate, Method
from anyprobe.light.filtering import blur_cap

RADII_DEG = (15, 30)
"""Radii of the caps that display values are averaged over."""


def from_truth() -> dict[str, Method]:
    """Methods that see the truth; none has light above white."""
    methods: dict[str, Method] = {"one flat colour (the truth's mean)": flat}
    for degrees in RADII_DEG:
        methods[f"truth blurred by {degrees} degrees"] = lambda pair, degrees=degrees: blurred(pair, degrees)
    return methods


def flat(pair: Pair) -> Estimate:
    """The mean of the true map's display values, everywhere."""
    ldr = response(pair.radiance)
    return _of(np.broadcast_to(ldr.mean(axis=(0, 1), dtype=np.float64), ldr.shape))


def blurred(pair: Pair, degrees: float) -> Estimate:
    """The true map's display values, each the mean over a cap of that radius."""
    return _of(blur_cap(response(pair.radiance), np.radians(degrees)))


def _of(ldr: np.ndarray) -> Estimate:
    ldr = np.asarray(ldr, np.float32).clip(0.0, 1.0)
    return Estimate(ldr=ldr, radiance=inverse_response(ldr))
