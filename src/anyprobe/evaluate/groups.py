"""The groups of test pairs that figures are split by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.dataset.pair import Pair
from anyprobe.light.environment import integral
from anyprobe.light.main_light import find_main_light

ALPHA_EDGES = (0.0, 0.1, 0.25, 0.5, 0.75, 1.01)
"""Borders of the roughness bins; 0.5 is the paper's border of specular and diffuse."""
ONE_LIGHT = 0.3
"""One light dominates where it sends this share of all light or more."""
SHINY = 0.3
"""Below this alpha an object shows lamps as highlights."""

Group = Callable[[Pair, bool], bool]
"""Whether a pair belongs, told whether one light dominates its true map."""


def main_light_share(radiance: np.ndarray) -> float:
    """Share of a map's flux that its main light has, by luminance: E on a plane facing it / all light."""
    whole = float(luminance(integral(radiance.astype(np.float64))))
    return float(luminance(find_main_light(radiance).irradiance)) / max(whole, 1e-9)


def _in_bin(low: float, high: float) -> Group:
    return lambda pair, single: low <= pair.material.alpha < high


GROUPS: dict[str, Group] = {
    "all": lambda pair, single: True,
    "specular": lambda pair, single: pair.specular,
    "diffuse": lambda pair, single: not pair.specular,
    "indoor": lambda pair, single: pair.indoor,
    "outdoor": lambda pair, single: not pair.indoor,
    **{
        f"alpha {low:g}-{min(high, 1.0):g}": _in_bin(low, high)
        for low, high in zip(ALPHA_EDGES[:-1], ALPHA_EDGES[1:], strict=True)
    },
    "one light": lambda pair, single: single,
    "one light, shiny": lambda pair, single: single and pair.material.alpha < SHINY,
    "one light, diffuse": lambda pair, single: single and not pair.specular,
}


def groups_of(pair: Pair) -> set[str]:
    """Names of the groups that a pair belongs to."""
    single = main_light_share(pair.radiance) >= ONE_LIGHT
    return {name for name, belongs in GROUPS.items() if belongs(pair, single)}
