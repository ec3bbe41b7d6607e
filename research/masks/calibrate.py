"""python -m research.masks.calibrate: what each kind of evidence is worth for a network's masks.

Asked is without a prompt, by a click and by a box, in rendered scenes of training assets, in photos, and in cluttered
ones, where the object of one is pasted into another. There nobody said which of two is meant without a prompt: the
nearer counts. Weights are of a ridge regression of the IoU's log-odds, none below LEAST; those of the contract's mask
quality are copied from here by hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.cli.app import main as run_command
from anyprobe.masks.networks import Network, SmallNetwork, U2NetP
from anyprobe.masks.quality import QUALITY, Evidence, examine
from anyprobe.masks.search import Looks, Prompts, find_object
from research.masks.cases import Case, iou, photo_cases
from research.masks.clutter import cluttered
from research.masks.scoring import BAD, GOOD

RIDGE, SPREAD, FOLDS, ROUNDS = 6.0, 0.05, 6, 2000
CLIP = 0.03
LEAST = {"agreed": 1.5}
"""Least weights, others 0: a second look that finds something else is rare in what is fitted, and always a doubt."""

THRESHOLDS = (0.5, 0.6, 0.7, 0.8, 0.81, 0.82, 0.85, 0.88, 0.9, 0.92, 0.94)


def calibrate(
    data: Annotated[Path, typer.Option(help="Folder with hdri/train and meshes/train.")],
    scenes: Annotated[int, typer.Option(min=2 * FOLDS, help="Scenes to render.")] = 48,
    photos: Annotated[
        list[Path] | None, typer.Option(help="Folder of photos NAME.* with NAME_mask.png beside them; repeatable.")
    ] = None,
    clutter: Annotated[int, typer.Option(min=0, help="Cluttered pictures to make of scenes, and of photos.")] = 48,
    seed: Annotated[int, typer.Option(help="Of scenes and clutter.")] = 779,
    small: Annotated[bool, typer.Option(help="Of the small network, not of U2-Net-p.")] = False,
) -> None:
    """Print by threshold how many bad and good masks would be warned of, by the contract and cross-validated over
    scenes and objects, with standard errors; then offset and weights of all."""
    network = SmallNetwork() if small else U2NetP()
    asked = [
        (fold, *one)
        for fold, case, other in _cases(data, scenes, photos or [], clutter, seed)
        for one in ask(network, case, other)
    ]
    names = list(QUALITY[network.name]["weights"])
    least = np.array([LEAST.get(name, 0.0) for name in names])
    number = np.array([fold for fold, *_ in asked])
    values = np.array([[asdict(evidence)[name] for name in names] for _, evidence, _ in asked])
    true = np.array([one for *_, one in asked])
    left_out = np.zeros(len(true))
    for fold in range(FOLDS):
        mine = number == fold
        weights, offset = fit(values[~mine], true[~mine], least)
        left_out[mine] = 1 / (1 + np.exp(-(values[mine] @ weights + offset)))
    shipped = np.array([evidence.expected_iou(network.name) for _, evidence, _ in asked])
    for threshold in THRESHOLDS:
        said = []
        for what, expected in (("contract", shipped), ("left out", left_out)):
            bad, good = (_share(expected[chosen] < threshold) for chosen in (true < BAD, true > GOOD))
            said.append(f"{what} {bad} bad, {good} good")
        typer.echo(f"below {threshold:.2f}: {'; '.join(said)}")
    weights, offset = fit(values, true, least)
    shown = ", ".join(f'"{name}": {weight:.2f}' for name, weight in zip(names, weights, strict=True))
    typer.echo(f'"{network.name}": {{ "offset": {offset:.2f}, "weights": {{ {shown} }} }}')


def _share(warned: np.ndarray) -> str:
    """How many of [N] bool, and the share's standard error in hundredths."""
    count = len(warned)
    share = warned.sum() / max(count, 1)
    return f"{warned.sum()} of {count} ({share:.0%} +- {np.sqrt(share * (1 - share) / max(count, 1)):.0%})"


def _cases(
    data: Path, scenes: int, photos: list[Path], clutter: int, seed: int
) -> Iterator[tuple[int, Case, Case | None]]:
    """Fold, case, and the other object beside it; clutter is made of what is in one fold."""
    from anyprobe_train.dataset.asset_store import load_asset_store
    from research.masks.scenes import rendered_cases

    drawn = list(rendered_cases(load_asset_store(data, "train", commercial_only=True), scenes, seed))
    taken = [case for folder in photos for case in photo_cases(folder)]
    objects = sorted({case.group for case in taken})
    for fold in range(FOLDS):
        here = [case for case in taken if objects.index(case.group) % FOLDS == fold]
        for mine in filter(None, (drawn[fold::FOLDS], here)):
            yield from ((fold, case, None) for case in mine)
            for both in cluttered(mine, clutter // FOLDS, seed + fold):
                yield from ((fold, both.first, both.second), (fold, both.second, both.first))


def ask(network: Network, case: Case, other: Case | None = None) -> Iterator[tuple[Evidence, float]]:
    """Evidence and IoU of the masks found without a prompt, of the nearer of two objects, by a click and by a box."""
    height, width = case.mask.shape
    for prompts in (Prompts(), Prompts(on=[case.click]), Prompts(box=case.box)):
        found = find_object(Looks(network, case.rgb), prompts)
        if found is not None:
            mask = found.mask(width, height)
            meant = [case] if other is None or prompts != Prompts() else [case, other]
            yield examine(found, width, height, prompts), max(iou(mask, one.mask) for one in meant)


def fit(values: np.ndarray, true: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights [F], least or more, and offset of the log-odds of true [N] from values [N, F]."""
    likely = np.clip(true, CLIP, 1 - CLIP)
    odds = np.log(likely / (1 - likely))
    mean, spread = values.mean(axis=0), values.std(axis=0) + SPREAD
    scaled = (values - mean) / spread
    weights, offset = np.zeros(values.shape[1]), odds.mean()
    for _ in range(ROUNDS):
        for k in range(len(weights)):
            column = scaled[:, k]
            rest = odds - offset - scaled @ weights + column * weights[k]
            weights[k] = max(least[k] * spread[k], column @ rest / (column @ column + RIDGE))
        offset = (odds - scaled @ weights).mean()
    weights = weights / spread
    return weights, float(offset - weights @ mean)


if __name__ == "__main__":
    run_command(lambda: typer.run(calibrate))
