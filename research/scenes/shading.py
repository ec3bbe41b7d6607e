"""How far off an estimate's shading of a matte sphere is, in stops, see match.shading.shading_apart; how far off its
level is; and how much light objects reflect."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.estimate.runtime import Models
from anyprobe.match.shading import shading_apart
from anyprobe.render.spheres import diffuse, sphere_normals
from research.scenes.estimates import estimates_of

QUANTILES = (0.5, 0.8, 0.9)
SPREAD = (0.1, 0.25, 0.5, 0.75, 0.9)
SIDE = 24
"""Side [px] of a white sphere."""


def shading_errors(folder: Path, models: Models) -> dict[str, list[float]]:
    """Return figures of whole photos and of cut-outs.

    Number of pairs and QUANTILES of the error; SPREAD of the stops by which a sphere is too bright on its visible side;
    and, of whole photos, SPREAD of the object's radiance over that of a white sphere in its place.
    """
    found: dict[str, list[float]] = {"whole": [], "cut-out": []}
    levels: dict[str, list[float]] = {name: [] for name in found}
    reflected = []
    for one in estimates_of(sorted(folder.glob("*.npz")), models):
        kind = "cut-out" if one.is_cut_out else "whole"
        light, truth = (_level(radiance) for radiance in (one.shipped(), one.truth))
        found[kind].append(shading_apart(one.shipped(), one.truth))
        levels[kind].append(np.log2(light / truth))
        if not one.is_cut_out:
            reflected.append(luminance(one.own) / truth)
    said = {name: [len(all_), *np.quantile(all_, QUANTILES).round(2).tolist()] for name, all_ in found.items() if all_}
    said |= {f"{name}, level": np.quantile(all_, SPREAD).round(2).tolist() for name, all_ in levels.items() if all_}
    return said | {"reflected": np.nanquantile(reflected, SPREAD).round(2).tolist()}


def _level(radiance: np.ndarray) -> float:
    """Return the mean luminance of a white sphere's visible side."""
    return float(luminance(diffuse(radiance, SIDE)[sphere_normals(SIDE)[1]]).mean())
