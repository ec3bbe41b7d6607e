"""python -m research.masks.calibrate: what each kind of evidence is worth for a network's masks.

Asked is without a prompt, by clicks and by boxes, right and wrong ones, in rendered scenes of training assets, in
photos, and in cluttered ones, where the object of one is pasted into another. There nobody said which of two is meant
without a prompt: the nearer counts. Weights are of a ridged logistic regression of the IoU, none below LEAST or of the
wrong sign; those of the contract's mask quality are copied from here by hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.masks.check import MIN_OBJECT_PX
from anyprobe.masks.networks import Network, SmallNetwork, U2NetP
from anyprobe.masks.quality import QUALITY, Evidence, examine
from anyprobe.masks.search import Looks, Prompts, find_object
from research.masks.cases import Case, iou, photo_cases
from research.masks.clutter import cluttered
from research.masks.scoring import BAD, GOOD

RIDGE, SPREAD, FOLDS, ROUNDS, STEP = 2.0, 0.05, 6, 4000, 0.3
CLIP = 0.03
LEAST = {"agreed": 1.5}
"""Least weights, others 0: a second look that finds something else is rare in what is fitted, and always a doubt."""

AGAINST = ("cut",)
"""Evidence that speaks against a mask."""

NARROW, SHIFT, WIDE = (0.3, 0.55), (0.3, 0.6), (0.4, 1.2)
"""Of wrong boxes, in the object's sizes: what is missing at one side, how far it lies beside, what is too much."""

THRESHOLDS = (0.5, 0.6, 0.66, 0.7, 0.74, 0.76, 0.78, 0.8, 0.82, 0.85, 0.88, 0.9)


def calibrate(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri/train and meshes/train.")],
    scenes: Annotated[int, Parameter(help="Scenes to render."), bounded(2 * FOLDS)] = 48,
    photos: Annotated[
        list[Path] | None, Parameter(help="Folder of photos NAME.* with NAME_mask.png beside them; repeatable.")
    ] = None,
    clutter: Annotated[int, Parameter(help="Cluttered pictures to make of scenes, and of photos."), bounded(0)] = 48,
    seed: Annotated[int, Parameter(help="Of scenes and clutter.")] = 779,
    small: Annotated[bool, Parameter(help="Of the small network, not of U2-Net-p.")] = False,
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
    signs = np.array([-1.0 if name in AGAINST else 1.0 for name in names])
    least = np.array([LEAST.get(name, 0.0) for name in names])
    number = np.array([fold for fold, *_ in asked])
    values = np.array([[asdict(evidence)[name] for name in names] for _, evidence, _ in asked])
    true = np.array([one for *_, one in asked])
    left_out = np.zeros(len(true))
    for fold in range(FOLDS):
        mine = number == fold
        weights, offset = fit(values[~mine], true[~mine], signs, least)
        left_out[mine] = 1 / (1 + np.exp(-(values[mine] @ weights + offset)))
    shipped = np.array([evidence.expected_iou(network.name) for _, evidence, _ in asked])
    for threshold in THRESHOLDS:
        said = []
        for what, expected in (("contract", shipped), ("left out", left_out)):
            bad, good = (_share(expected[chosen] < threshold) for chosen in (true < BAD, true > GOOD))
            said.append(f"{what} {bad} bad, {good} good")
        print(f"below {threshold:.2f}: {'; '.join(said)}")
    weights, offset = fit(values, true, signs, least)
    shown = ", ".join(f'"{name}": {weight:.2f}' for name, weight in zip(names, weights, strict=True))
    print(f'"{network.name}": {{ "offset": {offset:.2f}, "weights": {{ {shown} }} }}')


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
    """Evidence and IoU of the masks found without a prompt, of the nearer of two objects, and by marks."""
    height, width = case.mask.shape
    looks = Looks(network, case.rgb)
    for prompts in (Prompts(), *marks(case)):
        found = find_object(looks, prompts)
        if found is not None:
            mask = found.mask(width, height)
            meant = [case] if other is None or prompts != Prompts() else [case, other]
            yield examine(found, prompts), max(iou(mask, one.mask) for one in meant)


def marks(case: Case) -> Iterator[Prompts]:
    """Two clicks and a box, and three wrong boxes: too narrow, beside the object, too wide."""
    rng = np.random.default_rng(int(case.mask.sum()))
    rows, columns = np.nonzero(case.mask > 0.5)
    any_place = rng.integers(len(rows))
    yield Prompts(on=[case.click])
    yield Prompts(on=[(columns[any_place] + 0.5, rows[any_place] + 0.5)])
    box, size = np.array(case.box, float), np.array([np.ptp(columns) + 1, np.ptp(rows) + 1] * 2)
    narrow, side = box.copy(), rng.integers(4)
    narrow[side] += (1 if side < 2 else -1) * rng.uniform(*NARROW) * size[side]
    shift = np.tile(rng.uniform(*SHIFT, 2) * rng.choice([-1, 1], 2), 2)
    wide = box + size * rng.uniform(*WIDE, 4) * (-1, -1, 1, 1)
    height, width = case.mask.shape
    for given in (box, narrow, box + shift * size, wide):
        x0, y0, x1, y1 = np.clip(given, 0, [width, height] * 2)
        if min(x1 - x0, y1 - y0) >= MIN_OBJECT_PX and (x1 - x0) * (y1 - y0) < width * height:
            yield Prompts(box=(float(x0), float(y0), float(x1), float(y1)))


def fit(values: np.ndarray, true: np.ndarray, signs: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights [F] of these signs and least sizes, and offset of the log-odds of true [N] from values [N, F]."""
    likely = np.clip(true, CLIP, 1 - CLIP)
    mean, spread = values.mean(axis=0), values.std(axis=0) + SPREAD
    scaled = (values - mean) / spread * signs
    weights, offset = np.zeros(values.shape[1]), 0.0
    for _ in range(ROUNDS):
        off = 1 / (1 + np.exp(-(scaled @ weights + offset))) - likely
        weights = np.maximum(weights - STEP * (scaled.T @ off + RIDGE * weights) / len(true), least * spread)
        offset -= STEP * off.mean()
    weights = weights * signs / spread
    return weights, float(offset - weights @ mean)


if __name__ == "__main__":
    run_command(calibrate)
