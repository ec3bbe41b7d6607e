"""How far off an estimate's shading of a matte sphere is, in stops, see match.shading.shading_apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.estimate.runtime import Models
from anyprobe.match.shading import shading_apart
from research.scenes.estimates import estimates_of

QUANTILES = (0.5, 0.8, 0.9)


def shading_errors(folder: Path, models: Models) -> dict[str, list[float]]:
    """Return number of pairs and QUANTILES of the error, of whole photos and of cut-outs."""
    found: dict[str, list[float]] = {"whole": [], "cut-out": []}
    for one in estimates_of(sorted(folder.glob("*.npz")), models):
        found["cut-out" if one.is_cut_out else "whole"].append(shading_apart(one.shipped(), one.truth))
    return {name: [len(all_), *np.quantile(all_, QUANTILES).round(2).tolist()] for name, all_ in found.items() if all_}
