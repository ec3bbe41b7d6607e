"""Networks and test pairs of a finished run, and what the three methods make of photos."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from anyprobe.errors import InputError
from anyprobe.learning.dataset.catalog import allows_commercial_use
from anyprobe.light.reconstruct import reconstruct
from research.fetch_assets.frozen_set import frozen_files
from research.paper_designs.blocks import picture_of
from research.paper_designs.designs import Designs
from research.paper_designs.judge import TEST_PAIRS, estimated_maps
from research.paper_designs.pairs import Batch, PairMaker, Which, balanced
from research.paper_designs.scale import SCALES
from research.paper_designs.tables import Tables, cached_tables
from research.paper_designs.train import KEPT_LOSSES, Run

MEASURED = 100
"""Test pairs of each side of the paper's border that figures are means of."""
METHODS = {"ours": "Ours", "georgoulis": "Georgoulis et al.", "meka": "Meka et al."}
"""Designs that the paper's Figs. 12 to 14 compare, and what they are called."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Trained:
    """nets and losses [steps, designs of KEPT_LOSSES] of a run; test: the tables that its test pairs are of."""

    run: Run
    nets: Designs
    losses: np.ndarray
    test: Tables


def trained(runs: Path, scale: str, pairs: int, seed: int) -> Trained:
    """A finished run in the folder that `train` wrote.

    Raises:
        InputError: there is none, or it has not ended.
    """
    run = Run(pairs=pairs, seed=seed, scale=SCALES[scale])
    path, command = runs / scale / run.name / "checkpoint.pt", f"train --scale {scale} --pairs {pairs} --seeds {seed}"
    if not path.is_file():
        raise InputError(f"{path}: expected a finished run, found none; python -m research.paper_designs {command}")
    state = torch.load(path, weights_only=True)
    if state["step"] < run.steps:
        raise InputError(f"{path}: expected step {run.steps}, got {state['step']}; go on: {command}")
    nets = Designs(run.scale, seed)
    nets.load_state_dict(state["nets"])

    def missing() -> Tables:
        raise InputError(
            f"{runs / scale}: expected tables_test.pt, found none; python -m research.paper_designs {command}"
        )

    test = cached_tables(runs / scale / "tables_test.pt", missing)
    losses = state["losses"].reshape(-1, len(KEPT_LOSSES)).numpy()
    return Trained(run=run, nets=nets, losses=losses, test=test)


@dataclass(frozen=True, kw_only=True, slots=True)
class Maps:
    """What methods make of B photos, and the truth where it is known.

    ldr: by method, and "truth", display values [B, rows, 2 rows, 3]. radiance: Eq. 7's of "ours".
    """

    ldr: dict[str, np.ndarray]
    radiance: np.ndarray


@torch.no_grad()
def maps_of(nets: Designs, batch: Batch, side: int, rows: int) -> Maps:
    """The maps of a batch, whose photos are `side` pixels high."""
    estimate = nets["image"](batch.photo)
    pixels, maps = estimated_maps(nets, batch, estimate, rows, side)
    ln_radiance = picture_of(nets["hdr"](pixels["ours"]), rows)
    shown = {name: _last(maps[name]) for name in METHODS} | {"truth": _last(picture_of(batch.ldr, rows))}
    radiance = reconstruct(maps["ours"].permute(0, 2, 3, 1), ln_radiance.permute(0, 2, 3, 1))
    return Maps(ldr=shown, radiance=radiance.numpy())


def judged_batch(one: Trained, chosen: Which) -> Batch:
    """Photos and truth of test pairs."""
    return PairMaker(one.test)(chosen)


def judged_pairs(one: Trained, specular: bool, count: int | None = None, shown: bool = False) -> Which:
    """Judge's test pairs of one side of the paper's border, alpha 0.5, or the first `count`, each of another map.

    shown: those alone whose map and shape have a licence under which a picture of them may be published.
    """
    every = balanced(one.test, TEST_PAIRS, 1)
    free = {Path(file.file).stem for file in frozen_files() if allows_commercial_use(file.licence)}
    names = [one.test.map_names[int(k)] for k in every.map], [one.test.shape_names[int(k)] for k in every.shape]
    places, seen = [], set()
    for place, (map_name, shape_name) in enumerate(zip(*names, strict=True)):
        if (int(every.material[place]) % 2 == 0) != specular:
            continue
        if shown and (not {map_name, shape_name} <= free or map_name in seen):
            continue
        seen.add(map_name)
        places.append(place)
    return Which(**{name: getattr(every, name)[places[:count]] for name in Which.__slots__})


def photo_of(batch: Batch, side: int) -> np.ndarray:
    """Photos of a batch on white, display values [B, side, side, 3]."""
    photo = _last(picture_of(batch.photo, side))
    return photo[..., :3] + 1.0 - photo[..., 3:]


def _last(x: torch.Tensor) -> np.ndarray:
    return x.permute(0, 2, 3, 1).float().numpy()
