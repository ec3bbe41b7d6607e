"""Table 1: the four designs on the same test pairs, beside what needs no network."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from anyprobe.core.response import response
from anyprobe.files.atomic import atomic_path
from anyprobe.light.filtering import blur_cap
from anyprobe.paper.chain import estimate_light
from anyprobe_train.evaluate.metrics import psnr, rmse, ssim
from anyprobe_train.evaluate.standard_errors import clustered_error
from anyprobe_train.paper.networks import ln_of_scaled, scaled_ln
from anyprobe_train.paper.open_tables import open_tables
from anyprobe_train.paper.pairs import PaperPairs, balanced
from anyprobe_train.paper.pieces import piece_named, steps_of
from anyprobe_train.paper.scores import blocks
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.sheets import as_pictures
from anyprobe_train.paper.shipped import shipped_net
from anyprobe_train.paper.tables import Tables
from anyprobe_train.paper.training import checkpoint_of, is_trained, net_in_chain

DESIGNS, AGAIN = ("direct", "irradiance", "ours", "ideal"), ("irradiance_again", "ours_again")
"""Designs by the pieces that were trained; two by a second seed: rows X_again, steps X to X_again show its effect."""
PRINTED = {
    "direct ldr": (13.9374, 0.2117, 0.3740),
    "direct hdr": (25.5962, 0.0577, 0.3701),
    "irradiance irradiance": (26.9803, 0.0449, 0.9502),
    "irradiance ldr": (16.4243, 0.1588, 0.4459),
    "irradiance hdr": (29.5844, 0.0409, 0.4284),
    "ours ldr": (17.8786, 0.1271, 0.5298),
    "ours hdr": (34.8689, 0.0181, 0.5594),
    "ideal ldr": (18.8466, 0.1148, 0.5745),
    "ideal hdr": (36.1276, 0.0156, 0.9383),
}
"""PSNR, RMSE and SSIM as the paper prints them."""
STAGES = {"irradiance": "I-Irradiance", "ldr": "LDR", "hdr": "HDR"}
TONE = 8.0
"""Radiance that the tone mapping before SSIM of HDR maps makes white; the paper does not print its own."""
EQUAL = 0.005
"""Half width of the interval within which two designs count as equal."""
BLUR_DEG = 15.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Rows:
    """Figures of pairs, by "method stage figure" [pairs], and which map and shape each pair has."""

    figures: dict[str, np.ndarray]
    maps: list[str]
    shapes: list[str]


@torch.no_grad()
def score_designs(runs: Path, setting: Setting, tables: Tables, mean_map: torch.Tensor, count: int) -> Rows:
    """Score every design that is trained, or ships, on `count` balanced pairs of tables."""
    names = [
        name
        for name in (*DESIGNS, *AGAIN)
        if is_trained(piece_named(name), setting, runs)
        or (not checkpoint_of(runs, name).is_file() and _ships(name, setting))
    ]
    nets = {name: net_in_chain(setting, runs, name)[0] for name in ("irradiance_net", "hdr_net", *names)}
    which = balanced(tables, count, 1)
    found: dict[str, list[float]] = {}
    for pairs in blocks(tables, which):
        truth = {"irradiance": pairs.irradiance[:, :3], "ldr": pairs.ldr, "hdr": scaled_ln(pairs.ln_radiance)}
        truths = {stage: as_pictures(one) for stage, one in truth.items()}
        for method, made in _methods(nets, pairs, mean_map):
            for stage, estimate in made.items():
                for one, true in zip(as_pictures(estimate), truths[stage], strict=True):
                    shown = (one, true) if stage != "hdr" else (_toned(one), _toned(true))
                    values = {"PSNR": psnr(one, true), "RMSE": rmse(one, true), "SSIM": ssim(*shown)}
                    for figure, value in values.items():
                        found.setdefault(f"{method} {stage} {figure}", []).append(float(value))
    return Rows(
        figures={key: np.asarray(values) for key, values in found.items()},
        maps=[tables.maps[k] for k in which.map],
        shapes=[tables.shapes[k] for k in which.shape],
    )


def _ships(name: str, setting: Setting) -> bool:
    """Return whether a piece ships, trained with all steps of a setting."""
    net = shipped_net(name, setting)
    return net is not None and net.step >= steps_of(piece_named(name), setting)


def _methods(nets: dict, pairs: PaperPairs, mean_map: torch.Tensor) -> Iterator[tuple[str, dict[str, torch.Tensor]]]:
    """Yield what each method makes of pairs, by stage."""
    for design in (name for name in (*DESIGNS, *AGAIN) if name in nets):
        first = {"direct": lambda photo: photo[:, :3], "ideal": lambda photo: pairs.irradiance[:, :3]}
        made = estimate_light(pairs.photo, first.get(design, nets["irradiance_net"]), nets[design], nets["hdr_net"])
        stages = {"ldr": made.ldr, "hdr": _scaled(made.radiance)}
        if design == "ideal":  # each network is given the true picture before it
            true = estimate_light(pairs.photo, first[design], lambda _: pairs.ldr, nets["hdr_net"])
            stages["hdr"] = _scaled(true.radiance)
        elif design == "irradiance":  # those of all designs
            stages["irradiance"] = made.irradiance
        yield design, stages
    blurred = blur_cap(pairs.ldr.permute(0, 2, 3, 1), np.radians(BLUR_DEG)).permute(0, 3, 1, 2)
    yield "mean map", {"ldr": mean_map.permute(2, 0, 1).expand_as(pairs.ldr)}
    yield "flat colour, the truth's mean", {"ldr": pairs.ldr.mean(dim=(2, 3), keepdim=True).expand_as(pairs.ldr)}
    yield f"truth blurred by {BLUR_DEG:.0f} degrees", {"ldr": blurred}


def _scaled(radiance: torch.Tensor) -> torch.Tensor:
    return scaled_ln(radiance.clip(min=1e-6).log()).clip(0.0, 1.0)


def _toned(scaled: np.ndarray) -> np.ndarray:
    return response(np.exp(ln_of_scaled(scaled)) / TONE)


def table(test: Rows, seen: Rows) -> str:
    """Write Table 1 in Markdown: ours on unseen maps and shapes, on seen ones, the paper's; then the steps."""
    lines = ["| | stage | PSNR | RMSE | SSIM | seen: RMSE | SSIM | the paper: PSNR | RMSE | SSIM |", "|---" * 10 + "|"]
    for key in dict.fromkeys(name.rsplit(" ", 1)[0] for name in test.figures):
        method, stage = key.rsplit(" ", 1)
        own = [test.figures[f"{key} {figure}"].mean() for figure in ("PSNR", "RMSE", "SSIM")]
        known = [seen.figures[f"{key} {figure}"].mean() for figure in ("RMSE", "SSIM")]
        printed = PRINTED.get(key)
        theirs = ["", "", ""] if printed is None else [f"{printed[0]:.2f}", f"{printed[1]:.4f}", f"{printed[2]:.3f}"]
        numbers = [f"{own[0]:.2f}", f"{own[1]:.4f}", f"{own[2]:.3f}", f"{known[0]:.4f}", f"{known[1]:.3f}", *theirs]
        lines.append(f"| {method} | {STAGES[stage]} | " + " | ".join(numbers) + " |")
    steps = []
    scored = [name for name in DESIGNS if f"{name} ldr RMSE" in test.figures]
    for worse, better in (*pairwise(scored), *pairwise(AGAIN), *zip(DESIGNS[1:], AGAIN, strict=False)):
        if not {f"{worse} ldr RMSE", f"{better} ldr RMSE"} <= test.figures.keys():
            continue
        gain = test.figures[f"{worse} ldr RMSE"] - test.figures[f"{better} ldr RMSE"]
        mean, reach = gain.mean(), 1.96 * clustered_error(gain, test.maps, test.shapes)
        steps.append(f"| {worse} to {better} | {mean:+.4f} +- {reach:.4f} | {verdict(mean, reach)} |")
    head = ["", "| step, gain in LDR RMSE, 95 % | unseen | |", "|---|---|---|"] if steps else []
    return "\n".join([*lines, *head, *steps]) + "\n"


def verdict(mean: float, reach: float) -> str:
    """Say what a paired difference and half its 95 % interval show."""
    if abs(mean) + reach <= EQUAL:
        return "equal"
    return "open" if abs(mean) <= reach else "decided" if mean > 0 else "reversed"


def write_table(
    data: Path | None, runs: Path, setting: Setting, *, threads: int = 1, say: Callable[[str], None] | None = None
) -> str:
    """Score the designs that are trained, and write runs/table_1.md, which is returned, and, pair by pair,
    runs/table_1.npz."""
    torch.set_num_threads(threads)
    seen, test = (open_tables(data, runs, setting, split, say) for split in ("train", "test"))
    mean_map, count = seen.mean_map(), setting.table_pairs
    rows = [score_designs(runs, setting, tables, mean_map, count) for tables in (test, seen)]
    text = table(*rows)
    with atomic_path(runs / "table_1.md") as path:
        path.write_text(text, encoding="utf-8")
    kept = {
        f"{name} {key}": x for name, one in zip(("unseen", "seen"), rows, strict=True) for key, x in one.figures.items()
    }
    with atomic_path(runs / "table_1.npz") as path, path.open("wb") as stream:
        np.savez_compressed(stream, **kept)  # type: ignore[arg-type]
    return text
