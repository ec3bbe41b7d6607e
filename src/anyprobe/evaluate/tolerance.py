"""How true the irradiance image must be: designs that see it, given better ones than the network's.

Between the estimate and the truth lie mixtures of the two; where the designs overtake the one
that sees the photo itself, the irradiance network is good enough for the paper's order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.metrics import rmse, ssim

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the truth in the mixture."""
DESIGNS = ("irradiance", "ours")
NOTE = (
    "Designs given a mixture of estimated and true irradiance; share: of the truth. They were trained on a "
    "quarter true images and three quarters estimated ones."
)

Mixed = Callable[[str, Pair, float], tuple[np.ndarray, np.ndarray]]
"""A design's name, a pair and a share to the mixture [128, 128, 3] and the LDR map [64, 128, 3]."""


class Tolerance:
    """Means over pairs; `add` each."""

    def __init__(self, mixed: Mixed) -> None:
        self._mixed = mixed
        self._rows: list[dict[str, float]] = []

    def add(self, pair: Pair, direct: np.ndarray) -> None:
        """One pair, and the LDR map of the design that sees its photo."""
        truth, true_ldr = pair.irradiance / 255.0, response(pair.radiance)
        row = {"direct_ldr_rmse": rmse(direct, true_ldr), "direct_ldr_ssim": ssim(direct, true_ldr)}
        for share in SHARES:
            for name in DESIGNS:
                irradiance, ldr = self._mixed(name, pair, share)
                row[f"{share:g} irradiance_rmse"] = rmse(irradiance, truth)
                row[f"{share:g} irradiance_ssim"] = ssim(irradiance, truth)
                row[f"{share:g} {name}_ldr_rmse"] = rmse(ldr, true_ldr)
                row[f"{share:g} {name}_ldr_ssim"] = ssim(ldr, true_ldr)
        self._rows.append(row)

    def result(self) -> dict[str, Any]:
        """direct: its figures; rows: one a share."""
        means = {name: round(float(np.mean([row[name] for row in self._rows])), 5) for name in self._rows[0]}
        rows = []
        for share in SHARES:
            start = f"{share:g} "
            figures = {name.removeprefix(start): v for name, v in means.items() if name.startswith(start)}
            rows.append({"share": share, **figures})
        direct = {name.removeprefix("direct_"): means[name] for name in means if name.startswith("direct_")}
        return {"note": NOTE, "direct": direct, "rows": rows}


def tolerated(result: dict[str, Any], design: str, figure: str = "ldr_rmse") -> float | None:
    """The irradiance RMSE at which a design is level with direct, between rows; None if it never is."""
    direct = result["direct"][figure]
    ahead = [
        (direct - row[f"{design}_{figure}"]) * (1 if figure.endswith("rmse") else -1)
        for row in result["rows"]
    ]
    errors = [row["irradiance_rmse"] for row in result["rows"]]
    if ahead[0] > 0:
        return errors[0]
    for k in range(1, len(ahead)):
        if ahead[k] > 0:
            t = ahead[k - 1] / (ahead[k - 1] - ahead[k])
            return errors[k - 1] + t * (errors[k] - errors[k - 1])
    return None
