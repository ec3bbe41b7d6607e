"""Laboratory (noun): designs that learned from photos of one camera and eight materials, beside those of the world."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from anyprobe.evaluate.names import named
from anyprobe.evaluate.paper_rows import TABLE1
from anyprobe.evaluate.verdict import level_lines, limits_of, order_table, step_holds

LABORATORY = "laboratory"
"""The folder of its result files, in that of the others."""
SHOWN = ("irradiance_rmse", "irradiance_ssim", "ldr_rmse", "ldr_ssim", "hdr_rmse", "hdr_ssim")


def laboratory_lines(world: Mapping[str, Any], found: Mapping[str, Mapping[str, Any]]) -> Iterable[str]:
    """The section of the page, from the world's table1.json and the laboratory's files by name: table1, and perhaps
    irradiance and tolerance."""
    laboratory = found["table1"]
    rows, before = ({row["design"]: row for row in one["rows"]} for one in (laboratory, world))
    designs = laboratory["designs"]
    yield from ("", "### One camera and eight materials: an experiment", "")
    yield "The paper names no exposure, white balance or response curve that would differ between its photos, and its"
    yield 'material properties "are randomly selected for each rendering, resulting in 8 random materials"; ours'
    yield "differ, as photos and materials do. So the same designs learned again in a laboratory that makes it easier"
    yield "than both: one camera takes every photo, exposed by the scene's mean alone, no white balance, the mean"
    yield "curve, no noise, exact masks; four metals and four dielectrics, always the same. Beside camera and"
    yield "materials other things differ from the run above: there the designs learned from photos with noise, blur,"
    yield "JPEG and mask errors and are scored on clean ones, and their irradiance network, older than these pairs,"
    yield "stays as it is."
    yield f"They saw {designs['pairs']:,} pairs (seed {designs['seed']}); the irradiance network, the shipped one at"
    yield f"first, learned beside them, in all from {designs['irradiance_pairs']:,}. The {laboratory['pairs']:,}"
    yield "test pairs are of the same maps and shapes, none of which a network has seen, in this laboratory"
    yield f"(`{laboratory['command']}`, commit {laboratory['commit']})."
    yield ""
    heads = [name.replace("_", " ").replace("rmse", "RMSE").replace("ssim", "SSIM") for name in SHOWN]
    yield "| design | " + " | ".join(heads) + " |"
    yield "|" + "---|" * (len(heads) + 1)
    for name, row in rows.items():
        cells = [f"{row[figure]:.4f}" if figure in row else "-" for figure in SHOWN]
        yield f"| {named(name)} | " + " | ".join(cells) + " |"
    yield ""
    yield from order_table(laboratory["order"])
    yield ""
    yield from _verdict(rows, before, laboratory["order"])
    if "tolerance" in found:
        yield "- Given a mixture of estimated and true irradiance, as above:"
        yield from (f"  {line}" for line in level_lines(found["tolerance"]))
    if "irradiance" in found:
        surfaces = {
            group: {row["design"]: row for row in one["rows"]}["irradiance"]
            for group, one in found["irradiance"]["groups"].items()
        }
        yield from limits_of("irradiance image (as in the next section)", surfaces)


def _verdict(rows, before, order) -> Iterable[str]:
    ours, then, paper = (_irradiance(one) for one in (rows["ours"], before["ours"], TABLE1["ours"]))
    yield f"- Irradiance network: {ours}; that of the run above, which did not go on learning, {then}; in the paper"
    yield f"  {paper}."
    for step, figures in order.items():
        verdicts = [step_holds(name, one) for name, one in figures.items()]
        yield (
            f"- {step}: holds in {verdicts.count('holds')} of {len(verdicts)} figures, is open in "
            f"{verdicts.count('is open')}, reversed in {verdicts.count('is reversed')}."
        )


def _irradiance(row: Mapping[str, float]) -> str:
    return f"RMSE {row['irradiance_rmse']:.4f}, SSIM {row['irradiance_ssim']:.4f}"
