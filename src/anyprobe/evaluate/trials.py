"""Trials beside one another: what each changes of the first, pair by pair, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.metrics import rmse
from anyprobe.evaluate.panel import Estimate, Method
from anyprobe.evaluate.protocol import MEDIANS, score
from anyprobe.evaluate.study import clustered_error

FIGURES = {
    "ldr_rmse": "LDR RMSE",
    "ldr_ssim": "LDR SSIM",
    "ln_hdr_rmse": "ln HDR RMSE",
    "angle_diffuse_deg": "colour, white",
    "angle_silver_deg": "silver",
    "angle_mirror_deg": "mirror",
    "si_rmse_diffuse": "si-RMSE, white",
    "main_light_deg": "main light",
    "flux_stops": "flux, stops",
    "irradiance_rmse": "irradiance RMSE",
}
"""What is compared, and how the table calls it. All are means over pairs."""
WORLD = "ldr_rmse_world"
CHANCE = "lift_again"
"""The trial that differs from the first by chance alone."""
SURE = 2.0
"""Differences of so many standard errors, and so many times what chance did, are bold."""


@dataclass(kw_only=True)
class TrialScores:
    """Figures of every trial on every pair: trial -> figure -> one number a pair; whose each pair is beside them:
    conditions -> one map's and one shape's name a pair."""

    rows: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    places: dict[int, list[tuple[str, str]]] = field(default_factory=dict)

    def add(self, pair: Pair, estimates: Mapping[str, Estimate]) -> None:
        """One pair; those taken as the world gives them (conditions 1) only by their LDR map."""
        self.places.setdefault(pair.recipe.conditions, []).append((pair.map_name, pair.shape_name))
        for name, estimate in estimates.items():
            columns = self.rows.setdefault(name, {})
            for figure, value in _figures(pair, estimate).items():
                columns.setdefault(figure, []).append(value)

    def result(self) -> list[dict[str, Any]]:
        """A row a trial: its means, and what they differ by from the first trial's, with standard errors."""
        first = next(iter(self.rows.values()))
        rows = []
        for name, columns in self.rows.items():
            means = {figure: round(float(np.mean(values)), 5) for figure, values in columns.items()}
            medians = {
                median: round(float(np.median(columns[figure])), 5)
                for median, figure in MEDIANS.items()
                if figure in columns
            }
            rows.append({"trial": name, **means, **medians, "difference": self._differences(columns, first)})
        return rows

    def _differences(
        self, columns: Mapping[str, Sequence[float]], first: Mapping[str, Sequence[float]]
    ) -> dict[str, tuple[float, float]]:
        """Figure -> mean of one trial less the first, pair by pair, and its standard error (clustered_error)."""
        result = {}
        for figure in columns:
            d = np.subtract(columns[figure], first[figure])
            maps, shapes = zip(*self.places[int(figure == WORLD)], strict=True)
            result[figure] = (round(float(d.mean()), 5), round(clustered_error(d, maps, shapes), 5))
        return result


def _figures(pair: Pair, estimate: Estimate) -> dict[str, float]:
    if pair.recipe.conditions:
        return {WORLD: rmse(response(estimate.radiance), response(pair.radiance))}
    scores = score(estimate.radiance, pair.radiance)
    figures = {name: scores[name] for name in FIGURES if name in scores}
    if estimate.irradiance is not None:
        figures["irradiance_rmse"] = rmse(estimate.irradiance, pair.irradiance / 255.0)
    return figures


def score_trials(
    pairs: Iterable[Pair], methods: Mapping[str, Method], watch: Callable[[], None] | None = None
) -> TrialScores:
    """Every trial's figures on every pair; watch is called as each pair is done."""
    scores = TrialScores()
    for pair in pairs:
        scores.add(pair, {name: method(pair) for name, method in methods.items()})
        if watch is not None:
            watch()
    return scores


def trial_lines(content: Mapping[str, Any]) -> list[str]:
    """The Markdown table of trials.json: the first trial's figures, and by how much each other one's differ.

    One run of each says little: what differs by less than SURE times what chance did is not bold, however many
    pairs agree.
    """
    figures = {**FIGURES, WORLD: "LDR RMSE, world's photos"}
    lines = ["| trial | " + " | ".join(figures.values()) + " |", "|" + "---|" * (len(figures) + 1)]
    first, *others = content["rows"]
    chance = next((row["difference"] for row in others if row["trial"] == CHANCE), {})
    lines.append(f"| {first['trial']} | " + " | ".join(_text(first[one], one) for one in figures) + " |")
    for row in others:
        cells = [_cell(row, figure, chance) for figure in figures]
        lines.append(f"| {row['trial']} | " + " | ".join(cells) + " |")
    return lines


def _text(value: float, figure: str, sign: str = "") -> str:
    digits = 1 if figure.endswith("_deg") else 2 if figure == "flux_stops" else 4
    return f"{value:{sign}.{digits}f}"


def _cell(row: Mapping[str, Any], figure: str, chance: Mapping[str, Sequence[float]]) -> str:
    mean, error = row["difference"][figure]
    luck = abs(chance[figure][0]) if figure in chance else 0.0
    text = _text(mean, figure, "+")
    sure = row["trial"] != CHANCE and abs(mean) >= SURE * max(error, luck)
    return f"**{text}**" if sure else text
