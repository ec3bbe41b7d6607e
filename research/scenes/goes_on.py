"""How far what is seen goes on beside it: maps scored with other shares of the nearest seen place in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from anyprobe.core.response import response
from anyprobe.estimate.surroundings import GoesOn
from anyprobe_train.evaluate.metrics import power_ratio_stops, rmse
from anyprobe_train.whole_network.families import FAMILIES
from research.scenes.estimates import PairEstimate

TRIED = (
    GoesOn(0.0, 60.0),
    GoesOn(0.2, 60.0),
    GoesOn(0.3, 60.0),
    GoesOn(0.3, 100.0),
    GoesOn(0.5, 60.0),
    GoesOn(0.5, 100.0),
    GoesOn(0.6, 40.0),
    GoesOn(0.7, 30.0),
)


def goes_on_table(estimates: Iterable[PairEstimate]) -> Iterator[str]:
    """Yield a line for each of TRIED: LDR RMSE, by family too, and power [stops], of pairs with surroundings."""
    family, rows = [], []
    for one in estimates:
        if not one.is_cut_out:
            family.append(one.family)
            maps = [one.shipped(tried) for tried in TRIED]
            rows.append([(rmse(response(r), response(one.truth)), power_ratio_stops(r, one.truth)) for r in maps])
    families, figures = np.array(family), np.array(rows)
    for number, tried in enumerate(TRIED):
        ldr, power = figures[:, number].T
        by_family = ", ".join(
            f"{name} {ldr[families == k].mean():.4f}" for k, name in enumerate(FAMILIES) if (families == k).any()
        )
        mark = ", as shipped" if tried == GoesOn() else ""
        yield (
            f"share {tried.share:.1f}, {tried.reach_deg:.0f} degrees: LDR RMSE {ldr.mean():.4f} ({by_family}), "
            f"power {np.abs(power).mean():.3f}{mark}"
        )
