"""Surroundings that a turning camera shows, gathered in a fixed world frame.

One photo shows a window of the light; a turning camera shows more and more of it. What is seen is [64, 128, 4]: linear
radiance times cover, and cover in [0, 1]. Everything shown counts as infinitely far, as all light does here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.response import response
from anyprobe.estimate.light_graph import SEEN
from anyprobe.estimate.result import Light
from anyprobe.estimate.surroundings import LEAST_COVER

SHARED = 30
"""Smallest number of pixels that two windows must share to be compared."""
COMPARED = 0.02, 0.8
"""Radiance range in which two photos can be compared: neither noise nor clipped."""
DIFFER = 0.12
"""Mean difference of display values, exposure apart, above which the older view shows another light or place."""


def lay_over(newer: np.ndarray, older: np.ndarray | None) -> np.ndarray:
    """Return the newer view where it shows something, else the older, brought to the newer's exposure by what both
    show.

    older: None where there is none yet.

    Where both show the same place and differ, the older is dropped: a light was switched off, or the poses are wrong.
    """
    if older is None:
        return newer
    both = (newer[..., 3] > 0.5) & (older[..., 3] > 0.5)
    if both.sum() >= SHARED:
        now, then = (one[both, :3] / one[both, 3:4] for one in (newer, older))
        light = luminance(now), luminance(then)
        given = np.all([(one > COMPARED[0]) & (one < COMPARED[1]) for one in light], axis=0)
        gain = np.float32(np.median(light[0][given] / light[1][given])) if given.sum() >= SHARED else np.float32(1)
        if np.abs(response(now) - response(then * gain)).mean() > DIFFER:
            return newer
        older = np.concatenate([older[..., :3] * gain, older[..., 3:]], axis=-1)
    return newer + (1 - newer[..., 3:]) * older


def completed(light: Light, known: np.ndarray) -> Light:
    """Return a light with what is known beside its own photo's part, [64, 128, 4] in the camera's frame, in the map."""
    own = 0.0 if light.seen is None else light.seen[..., 3:]
    share = (known[..., 3:] * (1.0 - own)).clip(0.0, 1.0)
    shown = known[..., :3] / np.maximum(known[..., 3:], LEAST_COVER)
    radiance = (light.radiance + share * (shown - light.radiance)).astype(np.float32)
    if light.confidence is None:
        return replace(light, radiance=radiance)
    confidence = light.confidence + share[..., 0] * (SEEN - light.confidence)
    return replace(light, radiance=radiance, confidence=confidence.astype(np.float32))
