"""Scores of the light network on left-out photos: path-traced ones, also without their objects, cut-outs as evaluate
renders them, and four cross sets of the fast world: seen or new maps, seen or new shapes."""

from collections.abc import Callable, Iterator
from dataclasses import fields
from itertools import product
from operator import itemgetter
from pathlib import Path

import numpy as np
import torch

from anyprobe.core.response import response
from anyprobe.light.light_sources import LIKELY_DEG, find_dominant_light, find_sources
from anyprobe_train.evaluate.metrics import direction_error_deg, false_sources, power_ratio_stops, rmse
from anyprobe_train.evaluate.scoring import dominant_light_share
from anyprobe_train.light.both_ways import both_ways
from anyprobe_train.light.network import LeanNet, LightAnswer, LightInputs
from anyprobe_train.light.pictured import LightTruth, seen_again, tensors_of, without_object
from anyprobe_train.world.batch import PHOTO_FAMILIES, LightBatch, World, fieldwise, make_batch

AT_ONCE, FIRST_CUT_OUT = 32, PHOTO_FAMILIES.index("cut_out")
PARTS = {"seen": "train", "new": "left-out"}
CROSS_SEED, CROSS_BATCHES = 1_000_003, 2  # of each cross set
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
        likely = net.drawing.likely(guess.places, guess.directions, guess.exists, LIKELY_DEG)
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
                "pitch": abs(float(np.degrees(float(guess.posture[k, 0])) - pitch[at])),
                "outdoors": np.nan if np.isnan(known) else float(said == (known > 0.5)),
                "soft": float((float(guess.soft[k]) > 0) == (float(truth.soft[at]) > 0.5)),
                "lens": abs(float(np.degrees(2 * np.arctan(np.exp(float(guess.lens[k, 0])))) - float(truth.fov[at]))),
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


def left_out_scores(folder: Path, data: Path | None, cache: Path) -> Callable[[LeanNet], dict[str, float]]:
    """Return what scores a network by the batches of a folder, by those of its CUT_OUTS, and by the cross sets, which
    are made when they are asked for first."""
    cross: dict[str, list[LightBatch]] = {}

    def score(net: LeanNet) -> dict[str, float]:
        kept = kept_batches(folder)
        rows, bare = _rows(net, kept), _rows(net, kept, with_objects=False)
        whole, without = ([row for row in one if row["family"] < FIRST_CUT_OUT] for one in (rows, bare))
        found = summary(whole, "") if whole else {}
        parts = {name: [row for row in rows if row["family"] == number] for number, name in enumerate(PHOTO_FAMILIES)}
        parts["without"] = without
        for maps, shapes in product(PARTS, PARTS):
            name = f"{maps}_maps_{shapes}_shapes"
            if name not in cross:
                world = World.open(data, cache, PARTS[maps], PARTS[shapes], first=4, every=10**9)
                cross[name] = [make_batch(world, CROSS_SEED, k) for k in range(CROSS_BATCHES)]
            parts[name] = _rows(net, cross[name])
        for name, own in parts.items():
            short = summary(own, f"{name}_") if own else {}
            found |= {key: short[key] for key in short if key.endswith(("_ldr_rmse", "_dominant_deg"))}
        cut = _rows(net, kept_batches(folder / CUT_OUTS))
        return found | (summary(cut, "evaluate_") if cut else {})

    return score


def _rows(net: LeanNet, batches: list[LightBatch], *, with_objects: bool = True) -> list[dict[str, float]]:
    found: list[dict[str, float]] = []
    for batch in batches:
        inputs, truth = tensors_of(batch, str(next(net.parameters()).device))
        if not with_objects:
            every = torch.ones_like(truth.family, dtype=torch.bool)
            inputs = seen_again(without_object(inputs, every), every)
        found += rows_of(net, inputs, truth)
    return found
