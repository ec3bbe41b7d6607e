"""python -m research.masks.calibrate: what each kind of evidence is worth for a network's masks.

Asked is without a prompt, by a click and by a box, in rendered scenes of training assets, and in cluttered photos.
Weights are of a ridge regression of the IoU's log-odds, none of them negative; those of the contract's mask quality are
copied from here by hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.masks.networks import Network, SmallNetwork, U2NetP
from anyprobe.masks.quality import QUALITY, Evidence, examine
from anyprobe.masks.search import Prompts, find_object
from research.masks.cases import Case, iou, photo_cases
from research.masks.clutter import cluttered
from research.masks.scoring import BAD, GOOD

RIDGE, SPREAD, FOLDS, ROUNDS = 6.0, 0.05, 6, 2000
CLIP = 0.03
THRESHOLDS = (0.5, 0.6, 0.7, 0.75, 0.8, 0.81, 0.85)


def calibrate(
    data: Annotated[Path | None, typer.Option(help="Folder with hdri/train and meshes/train.")] = None,
    photos: Annotated[
        list[Path] | None, typer.Option(help="Folder of photos and masks to make cluttered photos of; repeatable.")
    ] = None,
    scenes: Annotated[int, typer.Option(min=FOLDS, help="Scenes to render.")] = 60,
    clutter: Annotated[int, typer.Option(min=0, help="Cluttered photos to make.")] = 48,
    seed: Annotated[int, typer.Option(help="Of scenes and cluttered photos.")] = 779,
    small: Annotated[bool, typer.Option(help="Of the small network, not of U2-Net-p.")] = False,
) -> None:
    """Print offset and weights, and by threshold how many bad and good masks would be warned of, cross-validated over
    the objects."""
    network = SmallNetwork() if small else U2NetP()
    asked = [(case.group, *one) for case in _cases(data, photos, scenes, clutter, seed) for one in ask(network, case)]
    groups, number = np.unique([group for group, *_ in asked], return_inverse=True)
    names = list(QUALITY[network.name]["weights"])
    values = np.array([[asdict(evidence)[name] for name in names] for _, evidence, _ in asked])
    true = np.array([one for *_, one in asked])
    expected = np.zeros(len(true))
    for fold in range(FOLDS):
        mine = number % FOLDS == fold
        weights, offset = fit(values[~mine], true[~mine])
        expected[mine] = 1 / (1 + np.exp(-(values[mine] @ weights + offset)))
    for threshold in THRESHOLDS:
        shares = [float((expected[chosen] < threshold).mean()) for chosen in (true < BAD, true > GOOD)]
        bad, good = (f"{shares[0]:.2f} of {(true < BAD).sum()} bad", f"{shares[1]:.2f} of {(true > GOOD).sum()} good")
        typer.echo(f"below {threshold:.2f}: {bad}, {good}")
    weights, offset = fit(values, true)
    shown = ", ".join(f'"{name}": {weight:.2f}' for name, weight in zip(names, weights, strict=True))
    typer.echo(f'"{network.name}": {{ "offset": {offset:.2f}, "weights": {{ {shown} }} }}, {len(groups)} objects')


def _cases(data, photos, scenes: int, clutter: int, seed: int) -> Iterator[Case]:
    if data is not None:
        from anyprobe.dataset.asset_store import load_asset_store
        from research.masks.scenes import rendered_cases

        yield from rendered_cases(load_asset_store(data, "train", commercial_only=True), scenes, seed)
    known = [case for folder in photos or [] for case in photo_cases(folder)]
    for both in cluttered(known, clutter, seed) if known else ():
        yield from (both.first, both.second)


def ask(network: Network, case: Case) -> Iterator[tuple[Evidence, float]]:
    """Evidence and IoU of the masks found without a prompt, by a click and by a box."""
    height, width = case.mask.shape
    for prompts in (Prompts(), Prompts(on=[case.click]), Prompts(box=case.box)):
        found = find_object(network, case.rgb, prompts)
        if found is not None:
            yield examine(found, width, height), iou(found.mask(width, height), case.mask)


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
