"""Scaling (noun): how far the paper's designs are from one another after few pairs and after many."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from anyprobe.evaluate.metrics import rmse, ssim
from anyprobe.evaluate.study import clustered_error, rounded
from anyprobe.evaluate.verdict import gain_cell, step_holds

DESIGNS = ("direct", "irradiance", "ours")
SECOND = "_2"
TOLD = ", told"
"""Given the true irradiance image; "ours, told" is the paper's Ideal."""
STEPS = {
    "direct -> irradiance": ("irradiance", "direct"),
    "irradiance -> ours": ("ours", "irradiance"),
    "ours -> ideal": (f"ours{TOLD}", "ours"),
    "direct -> irradiance told": (f"irradiance{TOLD}", "direct"),
    "irradiance told -> ours told": (f"ours{TOLD}", f"irradiance{TOLD}"),
}
"""What is compared: the better by the paper, and the worse."""
FIGURES = ("ldr_rmse", "ldr_ssim")
KINDS = {"fixed": "the paper's schedule", "again": "other pairs"}
"""What the page adds to a run's camera and materials for what its name ends with."""
CHANGE = "_change"
"""Ends the columns of a log that tell by how much a loss changes from step to step."""
SHAKEN = {
    "irradiance": ("irradiance", f"irradiance{SECOND}"),
    "ours, against its target": ("ours", f"ours{SECOND}"),
    "ours, against the sharp map": ("ours_sharp", f"ours{SECOND}_sharp"),
}
"""Whose changes the page tells, by both first weights."""
SETTLED = 0.1
"""Share of a run's rows after which its changes are read: the first are large in all."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shown:
    """What the tiny designs make of one pair, and the truth: maps [16, 32, 3] and irradiance images [32, 32, 3]."""

    maps: Mapping[str, np.ndarray]
    irradiance: np.ndarray
    true_map: np.ndarray
    true_irradiance: np.ndarray


@dataclass(kw_only=True)
class ScalingScores:
    """One run's figures on every pair: design -> figure -> one number a pair; the irradiance image's beside them."""

    designs: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    irradiance: dict[str, list[float]] = field(default_factory=lambda: {"rmse": [], "ssim": []})
    maps: list[str] = field(default_factory=list)
    shapes: list[str] = field(default_factory=list)

    def add(self, shown: Shown, map_name: str, shape_name: str) -> None:
        """One pair, and whose it is."""
        self.maps.append(map_name)
        self.shapes.append(shape_name)
        for name, ldr in shown.maps.items():
            columns = self.designs.setdefault(name, {figure: [] for figure in FIGURES})
            columns["ldr_rmse"].append(rmse(ldr, shown.true_map))
            columns["ldr_ssim"].append(ssim(ldr, shown.true_map, wrap_longitude=True))
        self.irradiance["rmse"].append(rmse(shown.irradiance, shown.true_irradiance))
        self.irradiance["ssim"].append(ssim(shown.irradiance, shown.true_irradiance))

    def result(self) -> dict[str, Any]:
        """Means of every design and of the irradiance image, and the paper's steps pair by pair."""
        return {
            "irradiance": {name: _mean(values) for name, values in self.irradiance.items()},
            "rows": [
                {"design": name, **{figure: _mean(values) for figure, values in columns.items()}}
                for name, columns in self.designs.items()
            ],
            "order": {
                step: {figure: self._difference(*sides, figure) for figure in FIGURES}
                for step, sides in STEPS.items()
            },
        }

    def _difference(self, better: str, worse: str, figure: str) -> dict[str, Any]:
        """Mean of better minus worse over both first weights and all pairs, its standard error (clustered_error),
        and what each first weights alone give."""
        each = [
            np.subtract(self._column(better, k, figure), self._column(worse, k, figure)) for k in ("", SECOND)
        ]
        d = np.mean(each, axis=0)
        return {
            "mean": _mean(d),
            "standard_error": rounded(clustered_error(d, self.maps, self.shapes), 5),
            "seeds": [_mean(one) for one in each],
        }

    def _column(self, design: str, which: str, figure: str) -> list[float]:
        name, told, _ = design.partition(TOLD)
        return self.designs[f"{name}{which}{told}"][figure]


def _mean(values: Iterable[float]) -> float:
    return round(float(np.mean(values)), 5)


def changes(columns: Mapping[str, Sequence[float]]) -> dict[str, dict[str, float]]:
    """Loss -> mean change from step to step as a share of the loss, of a log.csv that tells it (Fig. 6); else {}."""
    losses = [name.removesuffix(CHANGE) for name in columns if name.endswith(CHANGE)]
    if not losses:
        return {}
    start = int(SETTLED * len(columns[losses[0]]))
    means = {name: float(np.mean(values[start:])) for name, values in columns.items()}
    return {"changes": {name: round(means[f"{name}{CHANGE}"] / means[name], 4) for name in losses}}


def _kind(name: str) -> str:
    """What the page calls a run, beside its pairs."""
    first, *rest = name.split("_")
    return ", ".join([first, *(KINDS[part] for part in rest if part in KINDS)])


def scaling_lines(content: Mapping[str, Any]) -> Iterable[str]:
    """The section of the page, from scaling.json."""
    runs = content["runs"]
    yield from ("", "### More pairs: an experiment", "")
    yield "What would more pairs change? Direct, Irradiance and Ours learned once more on pictures of 32 x 32 pixels"
    yield "and maps of 16 x 32, where a core can show them many; clean photos and exact masks; each design from two"
    yield "first weights, an irradiance network for all learning beside them from nothing. Each run has a whole"
    yield "schedule of its own. *world*: cameras and materials as they come; *laboratory*: one camera and eight"
    yield "materials, as above; *the paper's schedule*: a learning rate that stays, maps that sharpen to the last step,"
    yield "where the others spend the last 30 % on sharp maps at a rate that falls. The"
    yield f"{content['pairs']:,} test pairs are of maps and shapes that no network has seen"
    yield f"(`{content['command']}`, commit {content['commit']})."
    yield "SSIM of maps this small goes around their seam, and does not compare with that of other tables."
    yield ""
    heads = [f"{name}: ldr RMSE | SSIM" for name in (*DESIGNS, "ideal")]
    yield "| run | pairs | irradiance image: RMSE | SSIM | " + " | ".join(heads) + " |"
    yield "|" + "---|" * 12
    for name, run in runs.items():
        rows = {row["design"]: row for row in run["rows"]}
        cells = [_kind(name), f"{run['pairs']:,}"]
        cells += [f"{run['irradiance'][figure]:.4f}" for figure in ("rmse", "ssim")]
        for design in (*DESIGNS, f"ours{TOLD}"):
            cells += [f"{_of_both(rows, design, figure):.4f}" for figure in FIGURES]
        yield "| " + " | ".join(cells) + " |"
    yield ""
    yield "The gain of each of the paper's steps (positive is better), pair by pair, mean of both first weights, with"
    yield f"its standard error ({content.get('standard_errors', 'by map')}); *told* is given the true irradiance image:"
    yield ""
    yield "| run | pairs | figure | " + " | ".join(STEPS) + " |"
    yield "|" + "---|" * (len(STEPS) + 3)
    for name, run in runs.items():
        for figure in FIGURES:
            cells = [_kind(name), f"{run['pairs']:,}", figure.replace("_", " ")]
            for step in STEPS:
                cells.append(gain_cell(figure, run["order"][step][figure]))
            yield "| " + " | ".join(cells) + " |"
    yield ""
    yield from _reading(runs)


def _reading(runs: Mapping[str, Any]) -> Iterable[str]:
    """What follows: by camera and materials what more pairs do to the irradiance image, and to each step."""
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for name, run in runs.items():
        kinds.setdefault(_kind(name), []).append(run)
    for kind, found in kinds.items():
        of_pairs = " and ".join(f"{run['pairs']:,}" for run in found)
        errors = " and ".join(f"{run['irradiance']['rmse']:.3f}" for run in found)
        alike = " and ".join(f"{run['irradiance']['ssim']:.3f}" for run in found)
        yield f"- {kind}, after {of_pairs} pairs: irradiance image RMSE {errors}, SSIM {alike}."
        for step in list(STEPS)[:3]:
            verdicts = [
                [
                    f"{figure.removeprefix('ldr_').upper()} {step_holds(figure, run['order'][step][figure])}"
                    for figure in FIGURES
                ]
                for run in found
            ]
            yield f"  {step}: {'; then '.join(', '.join(one) for one in verdicts)}."
        for one in [run["changes"] for run in found if "changes" in run]:
            told = [
                f"{title} {' and '.join(f'{one[name]:.1%}' for name in both)}"
                for title, both in SHAKEN.items()
            ]
            yield f"  Change of the loss from step to step, with each first weights: {', '.join(told)} of itself."


def _of_both(rows: Mapping[str, Mapping[str, float]], design: str, figure: str) -> float:
    """Mean of both first weights."""
    name, told, _ = design.partition(TOLD)
    return (rows[design][figure] + rows[f"{name}{SECOND}{told}"][figure]) / 2
