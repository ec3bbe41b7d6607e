"""python -m research.masks.calibrate: what each kind of evidence is worth, on rendered scenes of training assets.

The scenes are others than the network learned from. Weights are of a ridge regression of the IoU's log-odds, none of
them negative; those of `anyprobe.masks.quality` are copied from here by hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.dataset.asset_store import load_asset_store
from anyprobe.masks.cut import cut_out
from anyprobe.masks.propose import shared_network
from anyprobe.masks.quality import WEIGHTS, Evidence, examine
from research.masks.cases import Case, iou
from research.masks.scenes import rendered_cases
from research.masks.scoring import BAD, GOOD

RIDGE, SPREAD, FOLDS, ROUNDS = 6.0, 0.05, 6, 2000
CLIP = 0.03
THRESHOLDS = (0.5, 0.6, 0.7, 0.75, 0.8, 0.81, 0.85)


def calibrate(
    data: Annotated[Path, typer.Option(help="Folder with hdri/train and meshes/train.")],
    scenes: Annotated[int, typer.Option(min=FOLDS, help="Scenes to render.")] = 60,
    seed: Annotated[int, typer.Option(help="Of the scenes.")] = 779,
) -> None:
    """Print offset and weights, and by threshold how many bad and good masks would be warned of, cross-validated."""
    store = load_asset_store(data, "train", commercial_only=True)
    found = [(number, *one) for number, case in enumerate(rendered_cases(store, scenes, seed)) for one in _ask(case)]
    scene = np.array([number for number, *_ in found])
    names = list(WEIGHTS)
    values = np.array([[asdict(evidence)[name] for name in names] for _, evidence, _ in found])
    true = np.array([one for *_, one in found])
    expected = np.zeros(len(true))
    for fold in range(FOLDS):
        mine = scene % FOLDS == fold
        weights, offset = fit(values[~mine], true[~mine])
        expected[mine] = 1 / (1 + np.exp(-(values[mine] @ weights + offset)))
    for threshold in THRESHOLDS:
        shares = [float((expected[chosen] < threshold).mean()) for chosen in (true < BAD, true > GOOD)]
        bad, good = (f"{shares[0]:.2f} of {(true < BAD).sum()} bad", f"{shares[1]:.2f} of {(true > GOOD).sum()} good")
        typer.echo(f"below {threshold:.2f}: {bad}, {good}")
    weights, offset = fit(values, true)
    typer.echo(f"offset {offset:.2f}, " + ", ".join(f"{n} {w:.2f}" for n, w in zip(names, weights, strict=True)))


def _ask(case: Case) -> Iterator[tuple[Evidence, float]]:
    """Evidence and IoU of the masks found without a prompt, by a click and by a box."""
    network = shared_network()
    for prompts in (((), (), None), ((case.click,), (), None), ((), (), case.box)):
        proposal = network.propose(case.rgb, *prompts)
        cut = cut_out(case.rgb, proposal.cover, *prompts)
        if cut is not None and (cut.mask > 0.5).any():
            yield examine(network, case.rgb, proposal, cut, *prompts), iou(cut.mask, case.mask)


def fit(values: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights [F], 0 or more, and offset of the log-odds of true [N] from values [N, F]."""
    likely = np.clip(true, CLIP, 1 - CLIP)
    odds = np.log(likely / (1 - likely))
    mean, spread = values.mean(axis=0), values.std(axis=0) + SPREAD
    scaled = (values - mean) / spread
    weights, offset = np.zeros(values.shape[1]), odds.mean()
    for _ in range(ROUNDS):
        for k in range(len(weights)):
            column = scaled[:, k]
            rest = odds - offset - scaled @ weights + column * weights[k]
            weights[k] = max(0.0, column @ rest / (column @ column + RIDGE))
        offset = (odds - scaled @ weights).mean()
    weights = weights / spread
    return weights, float(offset - weights @ mean)


if __name__ == "__main__":
    typer.run(calibrate)
