"""How far what is seen goes on beside it: maps scored with other shares of the nearest seen place in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from anyprobe.core.response import response
from anyprobe.estimate.runtime import WHOLE, WHOLE_INPUTS, Models, Outputs
from anyprobe.estimate.surroundings import GOES_ON_DEG, GOES_ON_SHARE, GoesOn, use_surroundings
from anyprobe.evaluate.metrics import power_ratio_stops, rmse
from research.scenes.layouts import FAMILIES

TRIED = ((0.0, 60.0), (0.3, 100.0), (0.5, 60.0), (0.5, 100.0), (0.6, 40.0), (0.7, 30.0))
"""Shares at once, and degrees after which they are a factor e less."""


def goes_on_rows(files: Sequence[Path], models: Models) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the family, and LDR RMSE and power [stops] under each of TRIED [T, 2], of each pair with surroundings."""
    for path in files:
        with np.load(path) as stored:
            part = {name: stored[name] for name in stored.files if name != "image"}
        for k in range(len(part["up"])):
            context = part["context"][k].astype(np.float32).transpose(2, 0, 1)[None] / 255
            if not context[:, 4].any():
                continue
            lift, around = (part[name][k][None].astype(np.float32) for name in ("lift", "surroundings"))
            given = {
                "context": context,
                "tan_half": part["tan_half"][k].reshape(1, 1),
                "alone_expected": lift[:, :3],
                "alone_radiance": lift[:, 3:6],
                "alone_confidence": lift[:, 6:],
                "posterior": part["posterior"][k][None],
                "surroundings": around / 255,
                "up": np.zeros((1, 3), np.float32),
            }
            drawn, *_ = models._run[WHOLE](*(given[name] for name in WHOLE_INPUTS))
            radiance = np.exp(drawn[0]).transpose(1, 2, 0)
            guess = Outputs(radiance=radiance, irradiance=radiance, ldr=radiance, ln_radiance=radiance)
            truth = np.exp(part["truth"][k].astype(np.float32)).transpose(1, 2, 0)
            rows = []
            for share, reach_deg in TRIED:
                seen = around[0].transpose(1, 2, 0) / 255
                one = use_surroundings(guess, seen, goes_on=GoesOn(share, reach_deg)).radiance
                rows.append((rmse(response(one), response(truth)), power_ratio_stops(one, truth)))
            yield int(part["family"][k]), np.array(rows)


def goes_on_table(found: Sequence[tuple[int, np.ndarray]]) -> Iterator[str]:
    """Yield a line for each of TRIED."""
    family, rows = np.array([one[0] for one in found]), np.stack([one[1] for one in found])
    for number, (share, reach_deg) in enumerate(TRIED):
        mark = ", as shipped" if (share, reach_deg) == (GOES_ON_SHARE, GOES_ON_DEG) else ""
        by_family = ", ".join(
            f"{name} {rows[family == k, number, 0].mean():.4f}"
            for k, name in enumerate(FAMILIES)
            if (family == k).any()
        )
        yield (
            f"share {share:.1f}, {reach_deg:.0f} degrees: LDR RMSE {rows[:, number, 0].mean():.4f} ({by_family}), "
            f"power {np.abs(rows[:, number, 1]).mean():.3f}{mark}"
        )
