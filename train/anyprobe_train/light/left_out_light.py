"""Scores of the light network on photos that are left out: path-traced ones, and cut-outs as evaluate renders them."""

from collections.abc import Callable, Iterator
from dataclasses import fields
from operator import itemgetter
from pathlib import Path

import numpy as np
import torch

from anyprobe.core.response import response
from anyprobe.light.light_sources import find_dominant_light, find_sources
from anyprobe_train.evaluate.metrics import direction_error_deg, false_sources, power_ratio_stops, rmse
from anyprobe_train.evaluate.scoring import dominant_light_share
from anyprobe_train.light.both_ways import both_ways
from anyprobe_train.light.drawing import NEAR_DEG
from anyprobe_train.light.network import LeanNet, LightAnswer, LightInputs
from anyprobe_train.light.pictured import LightTruth, tensors_of
from anyprobe_train.world.batch import PHOTO_FAMILIES, LightBatch, fieldwise

AT_ONCE = 32
CUT_OUTS = "cut_outs"
"""Folder, beside the photos that are left out, of left-out cut-outs as the evaluation renders them."""


def kept_batches(folder: Path) -> list[LightBatch]:
    """Return the batches of a folder, files of their fields; none where there is none."""
    files = (np.load(path) for path in sorted(folder.glob("*.npz")))
    return [LightBatch(**{one.name: kept[one.name] for one in fields(LightBatch)}) for kept in files]


@torch.no_grad()
def answers(net: LeanNet, inputs: LightInputs) -> Iterator[LightAnswer]:
    """Answer photos, a few at a time."""
    was_training = net.training
    net.eval()
    for start in range(0, len(inputs.lens), AT_ONCE):
        yield both_ways(net, fieldwise(itemgetter(slice(start, start + AT_ONCE)), inputs))
    net.train(was_training)


def rows_of(net: LeanNet, inputs: LightInputs, truth: LightTruth) -> Iterator[dict[str, float]]:
    """Yield the figures of each photo: errors of display values, of the dominant light [degrees] and its true share, of
    power [stops], false sources, and what else is said."""
    at = 0
    for guess in answers(net, inputs):
        maps = torch.exp(guess.ln_radiance).permute(0, 2, 3, 1).cpu().numpy()
        likely = net.drawing.likely(guess.places, guess.directions, guess.exists, NEAR_DEG)
        sources = torch.cat([likely[..., None], guess.directions], dim=2).cpu().numpy()
        pitch = np.degrees(np.arcsin(truth.up[:, 2].cpu().numpy().clip(-1, 1)))
        for k, ours in enumerate(maps):
            true = truth.radiance[at].permute(1, 2, 0).cpu().numpy()
            said, known = float(guess.outdoors[k]) > 0, float(truth.outdoors[at])
            yield {
                "family": float(truth.family[at]),
                "ldr_rmse": rmse(response(ours), response(true)),
                "dominant": direction_error_deg(*(find_dominant_light(one).direction for one in (ours, true))),
                "share": dominant_light_share(true),
                "power": abs(power_ratio_stops(ours, true)),
                "false_sources": float(false_sources(find_sources(ours, sources[k]), ours, true)),
                "pitch": abs(float(np.degrees(guess.posture[k, 0].cpu())) - pitch[at]),
                "outdoors": np.nan if np.isnan(known) else float(said == (known > 0.5)),
                "soft": float((float(guess.soft[k]) > 0) == (float(truth.soft[at]) > 0.5)),
                "lens": abs(float(np.degrees(2 * np.arctan(np.exp(guess.lens[k, 0].cpu())))) - float(truth.fov[at])),
            }
            at += 1


def summary(rows: list[dict[str, float]], prefix: str) -> dict[str, float]:
    """Return means and medians of photos' figures."""
    of = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    hardest = of["share"] >= np.quantile(of["share"], 2 / 3)
    found = {
        "ldr_rmse": of["ldr_rmse"].mean(),
        "dominant_deg": np.median(of["dominant"]),
        "dominant_mean_deg": of["dominant"].mean(),
        "dominant_hardest_deg": np.median(of["dominant"][hardest]),
        "power": of["power"].mean(),
        "false_sources": of["false_sources"].mean(),
        "pitch_deg": np.median(of["pitch"]),
        "lens_deg": np.median(of["lens"]),
        "soft": of["soft"].mean(),
    }
    if not np.isnan(of["outdoors"]).all():
        found["outdoors"] = np.nanmean(of["outdoors"])
    return {f"{prefix}{name}": round(float(value), 4) for name, value in found.items()}


def left_out_scores(folder: Path) -> Callable[[LeanNet], dict[str, float]]:
    """Return what scores a network by the batches of a folder: whole photos, each family, and those of CUT_OUTS."""

    def score(net: LeanNet) -> dict[str, float]:
        rows = _rows(net, kept_batches(folder))
        whole = [row for row in rows if row["family"] < PHOTO_FAMILIES.index("cut_out")]
        found = summary(whole, "") if whole else {}
        for number, name in enumerate(PHOTO_FAMILIES):
            own = [row for row in rows if row["family"] == number]
            short = summary(own, f"{name}_") if own else {}
            found |= {key: short[key] for key in short if key.endswith(("_ldr_rmse", "_dominant_deg"))}
        cut = _rows(net, kept_batches(folder / CUT_OUTS))
        return found | (summary(cut, "evaluate_") if cut else {})

    return score


def _rows(net: LeanNet, batches: list[LightBatch]) -> list[dict[str, float]]:
    device = str(next(net.parameters()).device)
    return [row for batch in batches for row in rows_of(net, *tensors_of(batch, device))]
