"""Fixed camera (noun): designs that learned from photos of one camera that never changes, beside the world's.

What the paper says of its photos names no exposure, white balance or response curve that would differ between them;
where these do differ, a photo no longer tells how bright and of what colour the light is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from anyprobe.evaluate.paper_rows import TABLE1
from anyprobe.evaluate.verdict import order_table, step_holds

FIXED = "fixed_camera"
"""The folder of its result files, in that of the others."""
SHOWN = ("irradiance_rmse", "irradiance_ssim", "ldr_rmse", "ldr_ssim", "hdr_rmse", "hdr_ssim")


def fixed_camera_lines(world: Mapping[str, Any], fixed: Mapping[str, Any]) -> Iterable[str]:
    """The section of the page, from both files table1.json."""
    rows, before = ({row["design"]: row for row in one["rows"]} for one in (fixed, world))
    designs = fixed["designs"]
    yield from ("", "### One camera that never changes: an experiment", "")
    yield "What the paper says of its photos names no exposure, white balance or response curve that would differ"
    yield "between them; ours differ, as photos do. So the same designs learned again where one camera takes every"
    yield "photo: exposed by the scene's mean alone, whatever the object's albedo, no white balance, the mean curve,"
    yield f"no noise, exact masks. They saw {designs['pairs']:,} pairs (seed {designs['seed']}); the irradiance"
    yield f"network, the shipped one at first, learned beside them, in all from {designs['irradiance_pairs']:,}. The"
    yield f"{fixed['pairs']:,} test pairs are of the same maps, shapes and kinds of surface, photographed so"
    yield f"(`{fixed['command']}`, commit {fixed['commit']})."
    yield ""
    heads = [name.replace("_", " ").replace("rmse", "RMSE").replace("ssim", "SSIM") for name in SHOWN]
    yield "| design | " + " | ".join(heads) + " |"
    yield "|" + "---|" * (len(heads) + 1)
    for name, row in rows.items():
        cells = [f"{row[figure]:.4f}" if figure in row else "-" for figure in SHOWN]
        yield f"| {name.replace('_2', ', second seed')} | " + " | ".join(cells) + " |"
    yield ""
    yield from order_table(fixed["order"])
    yield ""
    yield from _verdict(rows, before, fixed["order"])


def _verdict(rows, before, order) -> Iterable[str]:
    ours, then, paper = (_irradiance(one) for one in (rows["ours"], before["ours"], TABLE1["ours"]))
    yield f"- Irradiance network: {ours}; with the world's cameras {then}; in the paper {paper}."
    for step, figures in order.items():
        verdicts = [step_holds(name, one) for name, one in figures.items()]
        yield (
            f"- {step}: holds in {verdicts.count('holds')} of {len(verdicts)} figures, is open in "
            f"{verdicts.count('is open')}, reversed in {verdicts.count('is reversed')}."
        )


def _irradiance(row: Mapping[str, float]) -> str:
    return f"RMSE {row['irradiance_rmse']:.4f}, SSIM {row['irradiance_ssim']:.4f}"
