"""What a study says of the paper's claims, in sentences made from its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

LOWER_IS_BETTER = ("ldr_rmse", "hdr_rmse")
SURE = 2.0
"""Standard errors from zero."""
RIVALS = ("georgoulis", "meka", "mean map", "chrome ball")


def step_holds(name: str, difference: Mapping[str, float]) -> str:
    """ "holds", "is reversed" or "is open": whether a step's mean gain is more than two standard errors."""
    gain = -difference["mean"] if name in LOWER_IS_BETTER else difference["mean"]
    if abs(gain) <= SURE * difference["standard_error"]:
        return "is open"
    return "holds" if gain > 0 else "is reversed"


def order_lines(table1: Mapping[str, Any]) -> Iterable[str]:
    """Each step of Direct < Irradiance < Ours < Ideal, figure by figure."""
    if not table1.get("order"):
        return
    yield from ("", "### Does the paper's order hold?", "")
    yield "Pair by pair, the second design minus the first: mean and standard error. A step holds (or is reversed)"
    yield "where the mean is more than two standard errors from zero; else it is open."
    yield ""
    names = list(next(iter(table1["order"].values())))
    yield "| step | " + " | ".join(name.replace("_", " ") for name in names) + " |"
    yield "|" + "---|" * (len(names) + 1)
    for step, figures in table1["order"].items():
        cells = []
        for name in names:
            one = figures[name]
            cells.append(f"{one['mean']:+.4f} +- {one['standard_error']:.4f}, {step_holds(name, one)}")
        yield f"| {step} | " + " | ".join(cells) + " |"
    yield ""
    short = [
        f"{step} in {name.replace('_', ' ')} ({step_holds(name, figures[name])})"
        for step, figures in table1["order"].items()
        for name in names
        if step_holds(name, figures[name]) != "holds"
    ]
    if short:
        yield "**Where this falls short of the paper's order:** " + "; ".join(short) + "."
    else:
        yield "Every step of the paper's order holds in every figure."


def rival_lines(fig13: Mapping[str, Any], ours: str = "ours") -> Iterable[str]:
    """Whether `ours` is better than every rival and baseline, group by group."""
    yield ""
    for group, one in fig13["groups"].items():
        rows = {row["design"]: row for row in one["rows"]}
        if ours not in rows:
            continue
        for name, better in (("ball_ssim", 1), ("ball_rmse", -1)):
            lost = [
                rival
                for rival in RIVALS
                if rival in rows and better * (rows[ours][name] - rows[rival][name]) <= 0
            ]
            verdict = (
                "is better than every rival and baseline"
                if not lost
                else f"is not better than {', '.join(lost)}"
            )
            yield f"- {group}, {name.replace('ball_', '').upper()}: {ours} {verdict}."
