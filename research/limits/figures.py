"""Limits: a model's figures beside those of less and of more that is given, by kind of material and alpha.

For each kind and bin: LDR RMSE and SSIM, RMSE after the best single gain, total power; for all pairs, the explained
variance of ln radiance and of display values in each order of spherical harmonics, against the mean map.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from anyprobe.core.response import response
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.metrics import gain_rmse, power_ratio_stops, rmse, ssim
from anyprobe_train.evaluate.scoring import ALPHA_EDGES
from research.limits.orders import ln_error, order_powers
from research.painted import is_painted

SMOOTH_BELOW = 0.25
"""Alpha below which a dielectric counts as smooth."""
MEAN_MAP = "mean map"

Maps = Mapping[str, Callable[[Pair], np.ndarray]]
"""Rows by name: from a pair to radiance [64, 128, 3]."""


def kind_of(pair: Pair) -> str:
    """metal, smooth, rough or, in the world's test sets, painted."""
    if is_painted(pair.recipe):
        return "painted"
    if not np.any(pair.material.albedo):
        return "metal"
    return "smooth" if pair.material.alpha < SMOOTH_BELOW else "rough"


def alpha_bin(pair: Pair) -> int:
    """Number of the bin of ALPHA_EDGES."""
    return int(np.searchsorted(ALPHA_EDGES, pair.material.alpha, side="right")) - 1


def groups(pair: Pair) -> list[str]:
    """all, its kind, its bin, its kind in its bin."""
    low, high = ALPHA_EDGES[alpha_bin(pair)], min(ALPHA_EDGES[alpha_bin(pair) + 1], 1.0)
    name = f"alpha {low:g}-{high:g}"
    return ["all", kind_of(pair), name, f"{kind_of(pair)}, {name}"]


def order(name: str) -> tuple:
    """Key that sorts names of groups as they are printed."""
    kinds = ("all", *distributions.KINDS)
    first = name.split(", ")[0]
    return ("," in name, kinds.index(first) if first in kinds else len(kinds), name)


def figures(estimate: np.ndarray, truth: np.ndarray) -> dict:
    """Of one map [64, 128, 3] against the true one."""
    ldr, true_ldr = response(estimate), response(truth)
    return {
        "rmse": rmse(ldr, true_ldr),
        "ssim": ssim(ldr, true_ldr),
        "gain_rmse": gain_rmse(estimate, truth),
        "power": power_ratio_stops(estimate, truth),
        "orders": ln_error(estimate, truth),
        "ldr_orders": order_powers((ldr - true_ldr).astype(np.float32)),
    }


def ldr_figures(ldr: np.ndarray, truth: np.ndarray) -> dict:
    """Of an LDR map, which has neither power nor ln radiance."""
    return {"rmse": rmse(ldr, response(truth)), "ssim": ssim(ldr, response(truth))}


class Limits:
    """Collects the figures of rows over pairs."""

    def __init__(self) -> None:
        self.rows: dict[str, list[dict]] = {}
        self.groups: list[list[str]] = []

    def add(self, pair: Pair, maps: Maps) -> None:
        """Score every row on a pair; MEAN_MAP has to be among them."""
        self.groups.append(groups(pair))
        for name, method in maps.items():
            self.rows.setdefault(name, []).append(figures(method(pair), pair.radiance))

    def add_ldr(self, name: str, pair: Pair, ldr: np.ndarray) -> None:
        """Score an LDR map as a row of its own on the pair that was added last."""
        self.rows.setdefault(name, []).append(ldr_figures(ldr, pair.radiance))

    def table(self) -> dict[str, dict[str, dict]]:
        """Group -> row -> figures: pairs, rmse, ssim, gain_rmse, power_median, power_mae, explained, explained_ldr."""
        names = sorted({name for one in self.groups for name in one}, key=order)
        result: dict[str, dict[str, dict]] = {}
        for group in names:
            chosen = [k for k, one in enumerate(self.groups) if group in one]
            result[group] = {
                row: self._summary([scores[k] for k in chosen], chosen) for row, scores in self.rows.items()
            }
        return result

    def _summary(self, scores: list[dict], chosen: list[int]) -> dict:
        made = {"pairs": len(scores)}
        made |= {name: round(float(np.mean([s[name] for s in scores])), 4) for name in ("rmse", "ssim")}
        if "power" not in scores[0]:
            return made
        power = np.array([s["power"] for s in scores])
        explained = {}
        for name, orders in (("explained", "orders"), ("explained_ldr", "ldr_orders")):
            base = np.sum([self.rows[MEAN_MAP][k][orders] for k in chosen], axis=0)
            left = np.sum([s[orders] for s in scores], axis=0) / base
            explained[name] = np.round(1 - left, 3).tolist()
        return made | {
            "gain_rmse": round(float(np.mean([s["gain_rmse"] for s in scores])), 4),
            "power_median": round(float(np.median(power)), 3),
            "power_mae": round(float(np.abs(power).mean()), 3),
            **explained,
        }
